//! The recorder on ARM's MPS2 board with the AN385 image (Cortex-M3), as QEMU emulates it.
//!
//! Three interrupts and a main loop: capture (highest priority), RS-232 in, RS-232 out, and `idle`, which
//! does all the rest, the GENI board included. They share no resource, hence nobody ever locks anything, and capture
//! waits for nobody.
#![no_std]
#![no_main]

// The start-up code and the vector table.
use cortex_m_rt as _;

mod device;
mod external_bus;
mod fault;
mod genius;
mod log;
mod mmio;
mod report;
mod stack;
mod timer;
mod uart;
mod watchdog;

#[rtic::app(device = crate::device, peripherals = false)]
mod app {
    use ser_node::{Capture, CaptureChannel, Event, Liveness, NoRtc, Node, NodeParts, VERSION};

    use crate::external_bus::{self, ConfigurationMemory};
    use crate::genius::Genius;
    use crate::report::Report;
    use crate::timer::{self, Timer};
    use crate::uart::{self, ReceiveInterrupt, Rings, SerialLine, TransmitInterrupt};
    use crate::watchdog::Watchdog;
    use crate::{fault, log};

    /// Events that the log holds: the largest size that can be configured.
    const LOG_LEN: usize = 2048;

    pub(crate) type BoardNode = Node<'static, ConfigurationMemory, NoRtc>;

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        timer: Timer,
        capture: Capture<'static>,
        input_mask: u32,
        receive: ReceiveInterrupt,
        transmit: TransmitInterrupt,
        serial: SerialLine,
        node: BoardNode,
        genius: Option<Genius>,
        watchdog: Watchdog,
    }

    #[init(local = [
        channel: CaptureChannel = CaptureChannel::new(),
        events: [Event; LOG_LEN] = [Event::EMPTY; LOG_LEN],
        rings: Rings = Rings::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let init::LocalResources { channel, events, rings, .. } = cx.local;
        log::start();
        let boot = external_bus::boot();
        let model = external_bus::model();
        defmt::info!("version {=u8}, {}, boot {=u32}", VERSION, model, boot.count);
        if let Some(fault) = external_bus::fault_name(boot.fault) {
            defmt::error!("the run before ended with a reset: {=str}", fault);
        }

        let (capture, reader) = channel.split(external_bus::debounce());
        let node = Node::new(NodeParts {
            model,
            log: events,
            capture: reader,
            storage: ConfigurationMemory,
            rtc: NoRtc,
        });
        let (serial, receive, transmit) = uart::start(rings, node.baud());
        // SAFETY: `init` runs once.
        let genius = unsafe { external_bus::GeniBoard::find() };
        let genius = genius.map(|(board, window)| Genius::new(board, window, model));
        let watchdog = Watchdog::start();
        let timer = Timer::start();
        (
            Shared {},
            Local {
                timer,
                capture,
                input_mask: model.mask(),
                receive,
                transmit,
                serial,
                node,
                genius,
                watchdog,
            },
        )
    }

    /// Takes a sample of all inputs.
    #[task(binds = TIMER0, priority = 3, local = [timer, capture, input_mask])]
    fn capture(cx: capture::Context) {
        if let Some(tick_ms) = cx.local.timer.on_interrupt() {
            let inputs = external_bus::read_inputs();
            cx.local.capture.sample(tick_ms, inputs & *cx.local.input_mask);
            external_bus::mark_sample(tick_ms, inputs);
        }
    }

    #[task(binds = UART0_RX, priority = 2, local = [receive])]
    fn receive(cx: receive::Context) {
        cx.local.receive.on_interrupt(timer::tick_ms());
    }

    #[task(binds = UART0_TX, priority = 1, local = [transmit])]
    fn transmit(cx: transmit::Context) {
        cx.local.transmit.on_interrupt();
    }

    #[idle(local = [serial, node, genius, watchdog])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources { serial, node, genius, watchdog, .. } = cx.local;
        let mut liveness = Liveness::new();
        let mut report = Report::new(node.tick_ms());
        loop {
            let now_ms = node.tick_ms();
            for _ in 0..uart::RECEIVE_RING_LEN {
                // Commands that find no room in the node wait in the ring.
                if !node.serial_has_room() {
                    break;
                }
                let Some(received) = serial.receive() else { break };
                node.serial_receive(received.byte, received.tick_ms);
                if received.overrun {
                    node.serial_line_error();
                }
            }
            node.poll(now_ms);
            if let Some(genius) = genius {
                genius.poll(node, now_ms);
            }
            change_baud(node, serial, now_ms);
            hand_out(node, serial);

            if liveness.pass(now_ms) {
                watchdog.feed();
                if fault::watchdog_fed() {
                    defmt::warn!("watchdog: fed at the last moment");
                }
            }
            report.pass(now_ms, || (node.diagnostics(), genius.as_ref().map(Genius::diagnostics)));

            // A byte that arrives just now waits for the next interrupt, a millisecond at most. Looking with
            // interrupts off would spare it that, and delay the capture interrupt instead.
            if !serial.has_received() {
                cortex_m::asm::wfi();
            }
        }
    }

    /// Hands out no more than the ring holds: a line that takes bytes as fast as they come must not keep the main loop.
    fn hand_out(node: &mut BoardNode, serial: &mut SerialLine) {
        for _ in 0..uart::TRANSMIT_RING_LEN {
            if !serial.can_send() {
                break;
            }
            let Some(byte) = node.serial_transmit() else { break };
            serial.send(byte);
        }
    }

    fn change_baud(node: &mut BoardNode, serial: &mut SerialLine, now_ms: u32) {
        let quiet = serial.is_quiet(now_ms);
        if let Some(baud) = node.baud_change()
            && quiet
        {
            serial.set_baud(baud);
            node.baud_changed(baud);
        }
    }
}
