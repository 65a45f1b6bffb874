//! The recorder on ARM's MPS2 board with the AN385 image (Cortex-M3), as QEMU emulates it.
//!
//! Three interrupts and a main loop: capture (highest priority), RS-232 in, RS-232 out, and `idle`,
//! which does all the rest, including the GENI board. They share no resource, so nothing is ever
//! locked, and capture waits for nobody.
#![no_std]
#![no_main]

// The start-up code and the vector table.
use cortex_m_rt as _;

mod boot;
mod configuration;
mod device;
mod external_bus;
mod fault;
mod forced;
mod inputs;
mod lamps;
mod log;
mod mmio;
mod rtc;
mod timer;
mod uart;
mod watchdog;

#[rtic::app(device = crate::device, peripherals = false)]
mod app {
    use core::mem::MaybeUninit;

    use ser_board::budget;
    use ser_board::health::Health;
    use ser_board::inputs::{Sample, Sampler};
    use ser_board::last_words::Boot;
    use ser_board::leds::Condition;
    use ser_board::main_loop;
    use ser_board::report::{self, Report};
    use ser_board::start::{self, BoardNode, BoardParts, Memory};
    use ser_cortex_m::held_off::HeldOff;
    use ser_cortex_m::protection::{self, Region};
    use ser_cortex_m::stack;
    use ser_node::{Capture, GeniusOptions, Liveness, VERSION};

    use crate::configuration::{self, BenchFlash};
    use crate::external_bus::{self, GeniBoard, Genius};
    use crate::inputs::{self, InputLatch};
    use crate::lamps::Lamps;
    use crate::rtc::{self, BenchClock};
    use crate::timer::{self, Timer};
    use crate::uart::{self, ReceiveInterrupt, Rings, SerialLine, TransmitInterrupt};
    use crate::watchdog::Watchdog;
    use crate::{fault, forced, log};

    /// There is no memory below the stack, and QEMU does not report that: it swallows what is
    /// written there.
    const BELOW_STACK: Region = Region::nothing(0x1000_0000, 0x1000_0000);

    // RTIC takes only literals for priorities. `crates/ser-board/tests/priorities.rs` checks that
    // the tasks have these.
    const _: () = {
        assert!(budget::CAPTURE_PRIORITY == 3);
        assert!(budget::RECEIVE_PRIORITY == 2);
        assert!(budget::TRANSMIT_PRIORITY == 1);
    };

    static HEALTH: Health<'static> = Health {
        inputs: &inputs::HEALTH,
        serialisers: None,
        clock: &rtc::HEALTH,
        storage: &configuration::HEALTH,
    };

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        timer: Timer,
        capture: &'static HeldOff<Capture<'static>>,
        capture_in_main: &'static HeldOff<Capture<'static>>,
        sampler: Sampler<'static, InputLatch>,
        receive: ReceiveInterrupt,
        transmit: TransmitInterrupt,
        serial: SerialLine,
        node: &'static mut BoardNode<'static, BenchFlash, BenchClock>,
        genius: Option<Genius>,
        lamps: Lamps,
        watchdog: Watchdog,
        was_fault: bool,
    }

    #[init(local = [
        held_off: MaybeUninit<HeldOff<Capture<'static>>> = MaybeUninit::uninit(),
        memory: Memory<'static, BenchFlash, BenchClock> = Memory::new(),
        rings: Rings = Rings::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        let init::LocalResources { memory, rings, held_off, .. } = cx.local;
        log::start();
        // SAFETY: the program uses nothing in that region.
        unsafe { protection::enable(&cx.core.MPU, [BELOW_STACK]) };
        // SAFETY: `init` runs once, with interrupts off.
        let boot = unsafe { fault::boot() };
        let count = external_bus::mark_boot(&boot);
        let model = external_bus::model();
        log_start(&boot, count, model);

        // SAFETY: `init` runs once.
        let clock = unsafe { BenchClock::open() };
        // SAFETY: as above.
        let flash = unsafe { BenchFlash::open() };
        let (debounce, id) = (external_bus::debounce(), external_bus::id());
        let parts = BoardParts { model, debounce, flash, clock, id };
        let (capture, node) = start::start(memory, parts, &HEALTH);
        let capture: &_ = held_off.write(HeldOff::new(capture));
        let (serial, receive, transmit) = uart::start(rings, node.baud());
        // SAFETY: as above.
        let genius = unsafe { GeniBoard::find() };
        let genius =
            genius.map(|(board, window)| Genius::new(board, window, GeniusOptions::new(model)));
        let sampler = Sampler::new(InputLatch, inputs::wiring(model), &inputs::HEALTH);
        let watchdog = Watchdog::start();
        let timer = Timer::start();
        external_bus::mark_boot_time(timer::since_reset_us());
        let lamps = Lamps::new();
        let was_fault = boot.cause.is_fault();
        (
            Shared {},
            Local {
                timer,
                capture,
                capture_in_main: capture,
                sampler,
                receive,
                transmit,
                serial,
                node,
                genius,
                lamps,
                watchdog,
                was_fault,
            },
        )
    }

    fn log_start(boot: &Boot, count: u32, model: ser_proto::Model) {
        defmt::info!("version {=u8}, {}, boot {=u32}: {}", VERSION, model, count, boot.cause);
        report::last_words(boot);
    }

    /// Takes a sample of all inputs.
    #[task(binds = TIMER0, priority = 3, local = [timer, sampler, capture])]
    fn capture(cx: capture::Context) {
        let capture::LocalResources { timer, sampler, capture, .. } = cx.local;
        if let Some(tick_ms) = timer.on_interrupt()
            && let Sample::Fresh(inputs) | Sample::Held(inputs) = sampler.sample()
        {
            // SAFETY: this interrupt only, once in each run.
            let capture = unsafe { capture.get() };
            capture.sample(tick_ms, inputs);
            external_bus::mark_sample(tick_ms, inputs);
        }
    }

    #[task(binds = UART0_RX, priority = 2, local = [receive])]
    fn receive(cx: receive::Context) {
        cx.local.receive.on_interrupt(timer::stamp());
    }

    #[task(binds = UART0_TX, priority = 1, local = [transmit])]
    fn transmit(cx: transmit::Context) {
        cx.local.transmit.on_interrupt();
    }

    #[idle(local = [serial, node, genius, lamps, watchdog, was_fault, capture_in_main])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources {
            serial,
            node,
            genius,
            lamps,
            watchdog,
            was_fault,
            capture_in_main,
            ..
        } = cx.local;
        let mut liveness = Liveness::new();
        let mut report = Report::new(node.tick_ms(), &HEALTH);
        loop {
            let now_ms = main_loop::pass(node, serial, genius.as_mut());
            main_loop::change_debounce(node, |times| {
                capture_in_main.with(|capture| capture.take_times(times))
            });
            let broken = HEALTH.is_broken();
            lamps.show(
                now_ms,
                &Condition::of(node, serial.bytes(), genius.as_ref(), broken, *was_fault),
            );
            if liveness.pass(now_ms) {
                watchdog.feed(now_ms);
                if fault::watchdog_fed() {
                    defmt::warn!("watchdog: fed at the last moment");
                }
            }
            report.pass(
                now_ms,
                || (node.diagnostics(), genius.as_ref().map(Genius::diagnostics)),
                stack_bytes,
            );
            forced::obey();

            // A byte that arrives right now waits for the next interrupt, a millisecond at most.
            // Looking with interrupts off would avoid that, but delay the capture interrupt
            // instead.
            if !serial.has_received() {
                cortex_m::asm::wfi();
            }
        }
    }

    /// The most bytes of the stack that have been in use; also shown to the bench.
    fn stack_bytes() -> usize {
        let bytes = stack::high_water();
        external_bus::mark_stack(bytes);
        bytes
    }
}
