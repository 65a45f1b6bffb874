//! The recorder on an STM32F407 (Cortex-M4F at 84 MHz), 144 pins: the board to flash.
//! `docs/hardware.md` says how it is wired.
//!
//! Four parts: capture (highest priority), RS-232 in both directions, the GENI board's line, and
//! the main loop, `idle`, which does all the rest. They share no resource, so nothing is ever
//! locked. Capture waits for nobody, not even for the flash: everything runs from RAM
//! (`ram-image.x`).
//!
//! # Tradeoffs
//! Registers are named by the register crate, without a HAL in between. `stm32f4xx-hal` takes the
//! ports of 16 inputs pin by pin, waits without bound, unwraps what it reads from the clock (whose
//! leap years it counts from 1970), knows only sectors of 128 KiB of the flash, and brings paths to
//! a panic into the image. It would have saved a few dozen lines in one file per part of the chip.
#![no_std]
#![no_main]

// The start-up code.
use cortex_m_rt as _;

mod boot;
mod chip;
mod clocks;
mod fault;
mod flash;
mod geni_bus;
#[cfg(not(feature = "serialiser"))]
mod inputs;
#[cfg(feature = "serialiser")]
#[path = "serialisers.rs"]
mod inputs;
mod lamps;
mod log;
mod pins;
mod protection;
mod reset;
mod rtc;
mod rtt;
mod straps;
mod timer;
mod uart;
mod watchdog;

#[rtic::app(device = stm32f4::stm32f407, peripherals = true)]
mod app {
    use core::mem::MaybeUninit;

    use ser_board::budget;
    use ser_board::health::Health;
    use ser_board::inputs::{InputHealth, Sample, Sampler};
    use ser_board::last_words::Boot;
    use ser_board::leds::Condition;
    use ser_board::main_loop;
    use ser_board::report::{self, Report};
    use ser_board::start::{self, BoardNode, BoardParts, Memory};
    use ser_cortex_m::held_off::HeldOff;
    use ser_cortex_m::{last_words, stack};
    use ser_node::{Capture, GeniusOptions, Liveness, VERSION};

    use crate::clocks::{self, Source};
    use crate::flash::{self, ConfigurationFlash};
    use crate::geni_bus::{GeniBoard, Genius, InterruptLine, Pulses};
    use crate::inputs::{self, InputPins};
    use crate::lamps::Lamps;
    use crate::rtc::{self, ChipClock};
    use crate::straps::Straps;
    use crate::timer::{self, Timer};
    use crate::uart::{self, Rings, SerialInterrupt, SerialLine};
    use crate::watchdog::Watchdog;
    use crate::{boot, chip, log, pins, protection, reset};

    // RTIC takes only literals for priorities. `crates/ser-board/tests/priorities.rs` checks that
    // the tasks have these.
    const _: () = {
        assert!(budget::CAPTURE_PRIORITY == 3);
        assert!(budget::RECEIVE_PRIORITY == 2);
        assert!(budget::EXTERNAL_BUS_PRIORITY == 1);
    };

    #[shared]
    struct Shared {}

    #[local]
    struct Local {
        timer: Timer,
        capture: &'static HeldOff<Capture<'static>>,
        capture_in_main: &'static HeldOff<Capture<'static>>,
        sampler: Sampler<'static, InputPins>,
        serial_interrupt: SerialInterrupt,
        geni_line: InterruptLine,
        serial: SerialLine,
        node: &'static mut BoardNode<'static, ConfigurationFlash, ChipClock>,
        genius: Option<Genius>,
        lamps: Lamps,
        watchdog: Watchdog,
        start: Start,
    }

    /// What start-up found and the lamps show.
    pub(crate) struct Start {
        clock_source: Source,
        was_fault: bool,
    }

    static INPUT_HEALTH: InputHealth = InputHealth::new();

    static HEALTH: Health<'static> = Health {
        inputs: &INPUT_HEALTH,
        serialisers: inputs::SERIALISERS,
        clock: &rtc::HEALTH,
        storage: &flash::HEALTH,
    };

    #[init(local = [
        held_off: MaybeUninit<HeldOff<Capture<'static>>> = MaybeUninit::uninit(),
        memory: Memory<'static, ConfigurationFlash, ChipClock> = Memory::new(),
        rings: Rings = Rings::new(),
        pulses: Pulses = Pulses::new(),
    ])]
    fn init(cx: init::Context) -> (Shared, Local) {
        boot::use_vectors_in_ram(&cx.core.SCB);
        let init::LocalResources { memory, rings, pulses, held_off, .. } = cx.local;
        let device = cx.device;
        let ports = pins::Ports {
            a: device.GPIOA,
            b: device.GPIOB,
            c: device.GPIOC,
            d: device.GPIOD,
            e: device.GPIOE,
            f: device.GPIOF,
            g: device.GPIOG,
        };
        pins::set_up(&device.RCC, &ports);
        let watchdog = Watchdog::start(&device.IWDG, &device.DBGMCU);
        let clock_source = clocks::start(&device.RCC, &device.FLASH);
        protection::enable(&cx.core.MPU);
        log::start(&device.DBGMCU);
        // SAFETY: `init` runs once, with interrupts off.
        let boot = unsafe { last_words::boot(|_| reset::take_flag(&device.RCC)) };
        let straps = Straps::read(&ports.e);
        let model = straps.model();
        defmt::info!("version {=u8}, {}, start {=u32}: {}", VERSION, model, boot.count, boot.cause);
        log_start(&boot, clock_source, reset::guards_brown_out(&device.FLASH));

        let parts = BoardParts {
            model,
            debounce: straps.debounce(),
            flash: ConfigurationFlash::new(device.FLASH, watchdog),
            clock: ChipClock::start(&device.RCC, &device.PWR, device.RTC),
            id: chip::id(),
        };
        let (capture, node) = start::start(memory, parts, &HEALTH);
        let capture: &_ = held_off.write(HeldOff::new(capture));
        let (serial, serial_interrupt) =
            uart::start(&device.RCC, device.USART2, rings, node.baud());
        let (pulsed, pulses) = pulses.split();
        let geni_line = InterruptLine::start(&device.RCC, &device.SYSCFG, device.EXTI, pulsed);
        let genius = if straps.has_geni() {
            // SAFETY: `init` runs once.
            unsafe { GeniBoard::open(&device.RCC, &device.FSMC, pulses) }
        } else {
            None
        };
        let genius =
            genius.map(|(board, window)| Genius::new(board, window, GeniusOptions::new(model)));
        #[cfg(not(feature = "serialiser"))]
        let contacts = InputPins { low: ports.b, middle: ports.c, high: ports.g };
        #[cfg(feature = "serialiser")]
        let contacts = InputPins::start(&device.RCC, device.SPI1, ports.a, model);
        let sampler = Sampler::new(contacts, inputs::wiring(model), &INPUT_HEALTH);
        let timer = Timer::start(&device.RCC, device.TIM2, device.TIM3);
        (
            Shared {},
            Local {
                timer,
                capture,
                capture_in_main: capture,
                sampler,
                serial_interrupt,
                geni_line,
                serial,
                node,
                genius,
                lamps: Lamps::new(ports.d),
                watchdog,
                start: Start { clock_source, was_fault: boot.cause.is_fault() },
            },
        )
    }

    fn log_start(boot: &Boot, clock_source: Source, guards_brown_out: bool) {
        report::last_words(boot);
        if clock_source == Source::RcOscillator {
            defmt::error!(
                "the crystal does not swing: time runs by the RC oscillator, off by up to \
                 several percent"
            );
        }
        if !guards_brown_out {
            defmt::warn!("the brown-out level of the option bytes is not 3 (2.7 V)");
        }
    }

    /// Takes a sample of all inputs.
    #[task(binds = TIM3, priority = 3, local = [timer, sampler, capture])]
    fn capture(cx: capture::Context) {
        let capture::LocalResources { timer, sampler, capture, .. } = cx.local;
        if let Some(tick_ms) = timer.on_interrupt()
            && let Sample::Fresh(inputs) | Sample::Held(inputs) = sampler.sample()
        {
            // SAFETY: this interrupt only, once in each run.
            let capture = unsafe { capture.get() };
            capture.sample(tick_ms, inputs);
        }
    }

    #[task(binds = USART2, priority = 2, local = [serial_interrupt])]
    fn serial(cx: serial::Context) {
        cx.local.serial_interrupt.on_interrupt(timer::stamp());
    }

    /// A datagram has arrived at the GENI board. Wakes the main loop.
    #[task(binds = EXTI9_5, priority = 1, local = [geni_line])]
    fn geni(cx: geni::Context) {
        cx.local.geni_line.on_interrupt(timer::tick_ms());
    }

    #[idle(local = [serial, node, genius, lamps, watchdog, start, capture_in_main])]
    fn idle(cx: idle::Context) -> ! {
        let idle::LocalResources {
            serial,
            node,
            genius,
            lamps,
            watchdog,
            start,
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
            let broken = start.clock_source != Source::Crystal || HEALTH.is_broken();
            lamps.show(
                now_ms,
                &Condition::of(node, serial.bytes(), genius.as_ref(), broken, start.was_fault),
            );
            if liveness.pass(now_ms) {
                watchdog.feed();
            }
            let diagnostics = || (node.diagnostics(), genius.as_ref().map(Genius::diagnostics));
            report.pass(now_ms, diagnostics, stack::high_water);

            // A byte that arrives right now waits for the next interrupt, a millisecond at most.
            // Looking with interrupts off would avoid that, but delay the capture interrupt
            // instead.
            if !serial.has_received() {
                cortex_m::asm::wfi();
            }
        }
    }
}
