//! Every pin, once: its purpose and its setup.
//!
//! # Design
//! [`ASSIGNMENTS`] is the only place where pins are assigned. The compiler turns it into register
//! values and refuses a table in which two assignments share a pin. `docs/hardware.md` gives the
//! same with package pins and parts.
//!
//! # Tradeoffs
//! With the external bus in place, no chip of the family has two whole ports left: of the 144 pins'
//! ports only B is whole. Inputs 17–32 are therefore half a port each, chosen so that no shifting
//! is needed: one load per port and one OR. The three loads are some 0.1 µs apart, which does not
//! matter to samples a millisecond apart.
//!
//! # Notes
//! Only the straps and the serial line's receiver have the chip's pull-ups. They are 30–50 kΩ, but
//! 8–15 kΩ at PA10 and PB12 (data sheet, "I/O static characteristics"), and a closed contact on
//! PB12 could not pull that to a valid low. They must also be off on a pin that is driven above the
//! chip's supply, as 5 V logic may do. External resistors therefore hold the field inputs and the
//! GENI board's lines, and where none is fitted the pin floats; `docs/hardware.md` gives the
//! values. Unlisted ports, and pins such as those of debugger and crystals, keep their reset state.

use stm32f4::stm32f407::{GPIOA, GPIOB, GPIOC, GPIOD, GPIOE, GPIOF, GPIOG, RCC};

#[derive(Clone, Copy, PartialEq, Eq)]
enum Port {
    A,
    B,
    C,
    D,
    E,
    F,
    G,
}

#[derive(Clone, Copy)]
enum Role {
    /// Without a pull-up: an external resistor holds it.
    Input,
    /// With the chip's pull-up: open is high.
    PulledInput,
    /// Push-pull, initially low.
    Output,
    /// Used by a peripheral, by the number of its alternate function.
    Alternate(u8),
    /// The same, with the chip's pull-up.
    PulledAlternate(u8),
    /// Not touched: the hardware gives it its role.
    Fixed,
}

impl Role {
    const fn is_pulled(&self) -> bool {
        matches!(self, Role::PulledInput | Role::PulledAlternate(_))
    }
}

/// Pins whose pull-up is four times as strong as all others; see the notes.
const fn strongly_pulled(port: Port) -> u16 {
    match port {
        Port::A => pin(10),
        Port::B => pin(12),
        _ => 0,
    }
}

struct Assignment {
    port: Port,
    pins: u16,
    role: Role,
}

/// Alternate function of the external bus.
const FSMC: u8 = 12;
/// Alternate function of SPI 1 and 2.
#[cfg(feature = "serialiser")]
const SPI: u8 = 5;
/// Alternate function of serial ports 1–3.
const USART: u8 = 7;

const ASSIGNMENTS: &[Assignment] = &[
    // Inputs 1–16.
    #[cfg(not(feature = "serialiser"))]
    assign(Port::B, range(0, 15), Role::Input),
    // Inputs 17–24.
    #[cfg(not(feature = "serialiser"))]
    assign(Port::C, range(0, 7), Role::Input),
    // Inputs 25–32.
    #[cfg(not(feature = "serialiser"))]
    assign(Port::G, range(8, 15), Role::Input),
    // Chip select, and clock, data in and data out of SPI1.
    #[cfg(feature = "serialiser")]
    assign(Port::A, pin(SERIALISER_SELECT), Role::Output),
    #[cfg(feature = "serialiser")]
    assign(Port::A, range(5, 7), Role::Alternate(SPI)),
    // Transmit and receive data of RS-232: USART2.
    assign(Port::A, pin(2), Role::Alternate(USART)),
    assign(Port::A, pin(3), Role::PulledAlternate(USART)),
    // SWDIO and SWCLK.
    assign(Port::A, range(13, 14), Role::Fixed),
    // 32 kHz crystal.
    assign(Port::C, range(14, 15), Role::Fixed),
    // D2, D3, /RD (NOE), /WR (NWE), /GENSEL (NE1), D0, D1.
    assign(Port::D, pins([0, 1, 4, 5, 7, 14, 15]), Role::Alternate(FSMC)),
    // D4–D7.
    assign(Port::E, range(7, 10), Role::Alternate(FSMC)),
    // A0–A5, A6–A9.
    assign(Port::F, range(0, 5) | range(12, 15), Role::Alternate(FSMC)),
    // A10–A13.
    assign(Port::G, range(0, 3), Role::Alternate(FSMC)),
    // /RST of the GENI board.
    assign(Port::G, pin(GENI_RESET), Role::Output),
    // /INT of the GENI board.
    assign(Port::G, pin(5), Role::Input),
    // /GENRDY of the GENI board: wired for measuring, see `geni_bus`.
    assign(Port::D, pin(6), Role::Input),
    assign(Port::D, pins([LAMP_RUN, LAMP_EVENT, LAMP_COMMUNICATION, LAMP_FAULT]), Role::Output),
    // Straps: see `straps`.
    assign(Port::E, range(0, 3), Role::PulledInput),
];

/// Number of the serialisers' chip select on port A.
#[cfg(feature = "serialiser")]
pub(crate) const SERIALISER_SELECT: u8 = 4;

/// Number of the GENI board's reset line on port G.
pub(crate) const GENI_RESET: u8 = 4;

/// Numbers of the lamps on port D.
pub(crate) const LAMP_RUN: u8 = 12;
pub(crate) const LAMP_EVENT: u8 = 13;
pub(crate) const LAMP_COMMUNICATION: u8 = 10;
pub(crate) const LAMP_FAULT: u8 = 11;

const fn assign(port: Port, pins: u16, role: Role) -> Assignment {
    Assignment { port, pins, role }
}

const fn pin(number: u8) -> u16 {
    1 << number
}

const fn range(first: u8, last: u8) -> u16 {
    (u16::MAX << first) & (u16::MAX >> (15 - last))
}

const fn pins<const N: usize>(numbers: [u8; N]) -> u16 {
    let mut set = 0;
    let mut index = 0;
    while index < N {
        set |= pin(numbers[index]);
        index += 1;
    }
    set
}

/// Bits of a register to set up, and their values.
#[derive(Clone, Copy)]
struct Bits {
    mask: u32,
    value: u32,
}

impl Bits {
    const NONE: Bits = Bits { mask: 0, value: 0 };

    /// Adds the field of `width` bits of a pin.
    const fn with(self, number: u32, width: u32, value: u32) -> Bits {
        let field = (1 << width) - 1;
        let shift = number % (32 / width) * width;
        Bits { mask: self.mask | field << shift, value: self.value | (value & field) << shift }
    }

    const fn in_place_of(self, before: u32) -> u32 {
        before & !self.mask | self.value
    }
}

/// The registers of a port.
struct SetUp {
    mode: Bits,
    pull: Bits,
    speed: Bits,
    alternate_low: Bits,
    alternate_high: Bits,
    data: Bits,
}

const INPUT: u32 = 0b00;
const OUTPUT: u32 = 0b01;
const ALTERNATE: u32 = 0b10;
const PULL_UP: u32 = 0b01;
const NO_PULL: u32 = 0b00;
/// 50 MHz at 40 pF: edges of the external bus within a few nanoseconds, without the overshoot of
/// the fastest setting.
const FAST: u32 = 0b10;

impl SetUp {
    const NONE: SetUp = SetUp {
        mode: Bits::NONE,
        pull: Bits::NONE,
        speed: Bits::NONE,
        alternate_low: Bits::NONE,
        alternate_high: Bits::NONE,
        data: Bits::NONE,
    };

    /// The registers of a port, from the table. Does not compile when a pin has two roles, or a
    /// pull-up that is stronger than the calculation allows.
    const fn of(port: Port) -> SetUp {
        let mut set_up = SetUp::NONE;
        let mut taken = 0;
        let mut row = 0;
        while row < ASSIGNMENTS.len() {
            let Assignment { port: its_port, pins, role } = &ASSIGNMENTS[row];
            if *its_port as u8 == port as u8 {
                assert!(taken & *pins == 0, "a pin has two roles");
                taken |= *pins;
                assert!(
                    !role.is_pulled() || *pins & strongly_pulled(port) == 0,
                    "a pull-up of 8–15 kΩ"
                );
                let mut number = 0;
                while number < 16 {
                    if *pins >> number & 1 != 0 {
                        set_up = set_up.with(number, *role);
                    }
                    number += 1;
                }
            }
            row += 1;
        }
        set_up
    }

    const fn with(self, number: u32, role: Role) -> SetUp {
        match role {
            Role::Input => self.plain(number, INPUT, NO_PULL),
            Role::PulledInput => self.plain(number, INPUT, PULL_UP),
            Role::Output => self.plain(number, OUTPUT, NO_PULL),
            Role::Alternate(function) => self.alternate(number, function, NO_PULL),
            Role::PulledAlternate(function) => self.alternate(number, function, PULL_UP),
            Role::Fixed => self,
        }
    }

    const fn plain(self, number: u32, mode: u32, pull: u32) -> SetUp {
        SetUp {
            mode: self.mode.with(number, 2, mode),
            pull: self.pull.with(number, 2, pull),
            data: self.data.with(number, 1, 0),
            ..self
        }
    }

    const fn alternate(self, number: u32, function: u8, pull: u32) -> SetUp {
        let function = function as u32;
        let mut set_up = SetUp {
            mode: self.mode.with(number, 2, ALTERNATE),
            pull: self.pull.with(number, 2, pull),
            speed: self.speed.with(number, 2, FAST),
            ..self
        };
        if number < 8 {
            set_up.alternate_low = set_up.alternate_low.with(number, 4, function);
        } else {
            set_up.alternate_high = set_up.alternate_high.with(number, 4, function);
        }
        set_up
    }
}

macro_rules! set_up {
    ($($port:ident: $registers:expr),* $(,)?) => {$({
        const SET_UP: SetUp = SetUp::of(Port::$port);
        let registers = $registers;
        // SAFETY: the table's values, in registers that take any value. The level and function of a
        // pin are set before its mode, so that no pin ever drives what it should not.
        unsafe {
            registers.odr().modify(|r, w| w.bits(SET_UP.data.in_place_of(r.bits())));
            registers.pupdr().modify(|r, w| w.bits(SET_UP.pull.in_place_of(r.bits())));
            registers.ospeedr().modify(|r, w| w.bits(SET_UP.speed.in_place_of(r.bits())));
            registers.afrl().modify(|r, w| w.bits(SET_UP.alternate_low.in_place_of(r.bits())));
            registers.afrh().modify(|r, w| w.bits(SET_UP.alternate_high.in_place_of(r.bits())));
            registers.moder().modify(|r, w| w.bits(SET_UP.mode.in_place_of(r.bits())));
        }
    })*};
}

/// The ports that are in use.
pub(crate) struct Ports {
    pub(crate) a: GPIOA,
    pub(crate) b: GPIOB,
    pub(crate) c: GPIOC,
    pub(crate) d: GPIOD,
    pub(crate) e: GPIOE,
    pub(crate) f: GPIOF,
    pub(crate) g: GPIOG,
}

/// Gives every pin its role. From here on the GENI board is held in reset until its port releases
/// it.
pub(crate) fn set_up(rcc: &RCC, ports: &Ports) {
    rcc.ahb1enr().modify(|_, w| {
        w.gpioaen().set_bit().gpioben().set_bit().gpiocen().set_bit().gpioden().set_bit();
        w.gpioeen().set_bit().gpiofen().set_bit().gpiogen().set_bit()
    });
    // A port answers two clocks after its own clock was switched on.
    let _ = rcc.ahb1enr().read();
    set_up!(A: &ports.a, B: &ports.b, C: &ports.c, D: &ports.d, E: &ports.e, F: &ports.f, G: &ports.g);
}
