//! Thumb-2 instructions, as far as they concern calls, jumps and the stack pointer.
//!
//! # Design
//! Every instruction is decoded well enough to know its length, its flow, its effect on the stack
//! pointer, and which registers it may change. What it computes does not matter, except for
//! constants: a call through a register that holds a constant is a call like any other.
//!
//! # Tradeoffs
//! If exact decoding would take a longer table, an instruction is assumed to change more registers
//! than it does. A constant is then forgotten, never invented.
//!
//! # Notes
//! Encodings are those of the ARMv7-M architecture reference manual (DDI 0403E), sections A5.2 and
//! A5.3.

/// Number of the stack pointer.
const SP: u16 = 13;
/// Number of the link register.
const LR: u16 = 14;
/// Number of the program counter.
const PC: u16 = 15;

/// Registers that a function may change: r0–r3, r12 and lr.
const CHANGED_BY_CALLS: u16 = 1 << 0 | 1 << 1 | 1 << 2 | 1 << 3 | 1 << 12 | 1 << LR;

/// Where execution continues after an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flow {
    /// At the next one.
    Next,
    /// At an address.
    Jump(u32),
    /// At an address or at the next one.
    Branch(u32),
    /// In the function at an address, and then at the next one.
    Call(u32),
    /// The same, with the address in a register.
    CallRegister(u16),
    /// At an address in a register.
    JumpRegister(u16),
    /// At the address in a word.
    JumpWord(u32),
    /// At an entry of the table of distances that follows; its entries have this many bytes.
    Table(u32),
    /// In the caller.
    Return,
    /// Nowhere: the instruction is there to fault.
    Stop,
    /// At the next one; from there on this many instructions are conditional.
    IfThen(u8),
    /// At an unknown place.
    Unknown,
}

/// What an instruction does to the stack pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stack {
    /// Makes the stack this many bytes deeper, or shallower if negative.
    Deeper(i32),
    /// Changes to another stack, at the address in a register.
    Change(u16),
    /// Has an effect that cannot be followed.
    Unknown,
}

/// A constant in a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Constant {
    /// The whole register.
    Whole(u32),
    /// Its upper half; the lower half is unchanged.
    Upper(u16),
    /// The word at an address.
    WordAt(u32),
}

/// One instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Instruction {
    /// Length in bytes.
    pub(crate) length: u32,
    pub(crate) flow: Flow,
    pub(crate) stack: Stack,
    /// The register and its new value.
    pub(crate) constant: Option<(u16, Constant)>,
    /// Registers whose value is no longer known, r0 in bit 0.
    pub(crate) changes: u16,
    /// Whether it needs the floating-point unit, whose registers exceptions then save.
    pub(crate) floating_point: bool,
}

/// Whether an instruction that begins with this halfword has a second one.
pub(crate) fn is_wide(first: u16) -> bool {
    first >> 11 > 0b11100
}

/// Decodes the instruction at `address`. `second` matters only for wide instructions.
pub(crate) fn decode(address: u32, first: u16, second: u16) -> Instruction {
    if is_wide(first) { wide(address, first, second) } else { narrow(address, first) }
}

impl Instruction {
    fn plain(length: u32, changes: u16) -> Instruction {
        let (flow, stack) = (Flow::Next, Stack::Deeper(0));
        Instruction { length, flow, stack, constant: None, changes, floating_point: false }
    }

    fn going(self, flow: Flow) -> Instruction {
        Instruction { flow, ..self }
    }

    fn stack(self, stack: Stack) -> Instruction {
        Instruction { stack, ..self }
    }

    fn holding(self, register: u16, constant: Constant) -> Instruction {
        Instruction { constant: Some((register, constant)), ..self }
    }
}

/// Instructions of 16 bits.
fn narrow(address: u32, op: u16) -> Instruction {
    let pc = address.wrapping_add(4);
    let (low, middle) = (1 << (op & 7), 1 << (op >> 8 & 7));
    let list = op & 0xFF;
    let plain = |changes| Instruction::plain(2, changes);
    match op >> 8 {
        // Shifts, sums; loads, stores; extensions, byte orders.
        0x00..=0x1F | 0x40..=0x43 | 0x50..=0x8F | 0xB2 | 0xBA => plain(low),
        0x44..=0x47 => high_registers(op),
        0x48..=0x4F => {
            let word = (pc & !3).wrapping_add(u32::from(list) * 4);
            plain(middle).holding(op >> 8 & 7, Constant::WordAt(word))
        }
        // Immediates; loads and stores at sp; addresses by pc and sp; stores of several registers.
        0x20..=0x3F | 0x90..=0xAF | 0xC0..=0xC7 => plain(middle),
        0xB0 => {
            let bytes = i32::from(op & 0x7F) * 4;
            plain(0).stack(Stack::Deeper(if op & 0x80 == 0 { -bytes } else { bytes }))
        }
        0xB1 | 0xB3 | 0xB9 | 0xBB => {
            let distance = u32::from(op >> 3 & 0x1F) * 2 + u32::from(op >> 9 & 1) * 64;
            plain(0).going(Flow::Branch(pc.wrapping_add(distance)))
        }
        // push, with lr or without
        0xB4 | 0xB5 => plain(0).stack(Stack::Deeper(words(op & 0x1FF))),
        0xBC => plain(list).stack(Stack::Deeper(-words(list))),
        // pop with pc
        0xBD => plain(list).stack(Stack::Deeper(-words(op & 0x1FF))).going(Flow::Return),
        0xBF if op & 0xF != 0 => plain(0).going(Flow::IfThen(if_then_len(op))),
        0xC8..=0xCF => plain(middle | list),
        0xD0..=0xDD => plain(0).going(Flow::Branch(pc.wrapping_add_signed(extended(list, 8) * 2))),
        0xDE => plain(0).going(Flow::Stop),
        0xE0..=0xE7 => {
            plain(0).going(Flow::Jump(pc.wrapping_add_signed(extended(op & 0x7FF, 11) * 2)))
        }
        // Breakpoints, hints, supervisor calls, interrupt masks.
        _ => plain(0),
    }
}

/// `add`, `cmp` and `mov` with any register, `bx`, `blx`.
fn high_registers(op: u16) -> Instruction {
    let to = op & 7 | op >> 4 & 8;
    let from = op >> 3 & 0xF;
    let plain = Instruction::plain(2, 1 << to);
    match (op >> 8, to) {
        (0x45, _) => Instruction::plain(2, 0),
        (0x47, _) if op & 0x80 != 0 => {
            Instruction::plain(2, CHANGED_BY_CALLS).going(Flow::CallRegister(from))
        }
        (0x47, _) | (0x46, PC) if from == LR => Instruction::plain(2, 0).going(Flow::Return),
        (0x47, _) | (0x46, PC) => Instruction::plain(2, 0).going(Flow::JumpRegister(from)),
        (_, PC) => plain.going(Flow::Unknown),
        (_, SP) => plain.stack(Stack::Unknown),
        _ => plain,
    }
}

/// Instructions of 32 bits.
fn wide(address: u32, first: u16, second: u16) -> Instruction {
    match first >> 9 & 0x3F {
        // E8, E9
        0b11_0100 if first & 1 << 6 == 0 => load_store_multiple(first, second),
        0b11_0100 => load_store_dual(first, second),
        // EC–EF, FC–FF
        0b11_0110 | 0b11_0111 | 0b11_1110 | 0b11_1111 => coprocessor(first, second),
        // F0–F7
        0b11_1000..=0b11_1011 if second & 1 << 15 == 0 => immediate(first, second),
        0b11_1000..=0b11_1011 => branch_or_control(address, first, second),
        // F8, F9
        0b11_1100 => load_store_single(address, first, second),
        // EA, EB, FA, FB
        _ => to_destination(first, second),
    }
}

/// All registers that the fields of a wide instruction can name.
fn named(first: u16, second: u16) -> u16 {
    1 << (first & 0xF) | 1 << (second >> 12) | 1 << (second >> 8 & 0xF) | 1 << (second & 0xF)
}

/// Arithmetic between registers.
fn to_destination(first: u16, second: u16) -> Instruction {
    let plain = Instruction::plain(4, named(first, second));
    if second >> 8 & 0xF == SP { plain.stack(Stack::Unknown) } else { plain }
}

fn load_store_multiple(first: u16, second: u16) -> Instruction {
    let (base, load, back) = (first & 0xF, first & 1 << 4 != 0, first & 1 << 5 != 0);
    let downwards = first & 1 << 8 != 0;
    let changes = if load { second | 1 << base } else { 1 << base };
    let mut instruction = Instruction::plain(4, changes);
    if base == SP && back {
        let bytes = words(second);
        instruction = instruction.stack(Stack::Deeper(if downwards { bytes } else { -bytes }));
    }
    match load && second & 1 << PC != 0 {
        true if base == SP => instruction.going(Flow::Return),
        true => instruction.going(Flow::Unknown),
        false => instruction,
    }
}

/// Loads and stores of two words, exclusive ones, table branches.
fn load_store_dual(first: u16, second: u16) -> Instruction {
    let (base, up, back) = (first & 0xF, first & 1 << 7 != 0, first & 1 << 5 != 0);
    let plain = Instruction::plain(4, named(first, second));
    if first & 0xFFF0 == 0xE8D0 && second & 0xFFE0 == 0xF000 {
        let entry = if second & 1 << 4 == 0 { 1 } else { 2 };
        return Instruction::plain(4, 0).going(if base == PC {
            Flow::Table(entry)
        } else {
            Flow::Unknown
        });
    }
    if base == SP && back { plain.stack(moved(up, i32::from(second & 0xFF) * 4)) } else { plain }
}

fn load_store_single(address: u32, first: u16, second: u16) -> Instruction {
    let (base, register) = (first & 0xF, second >> 12);
    let loads_word = first & 0xFF70 == 0xF850;
    let plain = Instruction::plain(4, named(first, second));
    if base == PC && loads_word {
        let at = (address.wrapping_add(4)) & !3;
        let distance = i32::from(second & 0xFFF);
        let word = at.wrapping_add_signed(if first & 1 << 7 == 0 { -distance } else { distance });
        return match register {
            PC => plain.going(Flow::JumpWord(word)),
            SP => plain.holding(SP, Constant::WordAt(word)).stack(Stack::Unknown),
            _ => plain.holding(register, Constant::WordAt(word)),
        };
    }
    // An 8-bit distance, which is also added to the base.
    let back = first & 1 << 7 == 0 && second & 0x0900 == 0x0900;
    let mut instruction = plain;
    if base == SP && back {
        instruction = instruction.stack(moved(second & 1 << 9 != 0, i32::from(second & 0xFF)));
    }
    match (loads_word, register) {
        (true, PC) if base == SP && back => instruction.going(Flow::Return),
        (true, PC) => instruction.going(Flow::Unknown),
        (true, SP) => instruction.stack(Stack::Unknown),
        _ => instruction,
    }
}

fn coprocessor(first: u16, second: u16) -> Instruction {
    let floating_point = matches!(second >> 8 & 0xF, 10 | 11);
    let mut instruction = Instruction::plain(4, named(first, second));
    instruction.floating_point = floating_point;
    let (base, up, back) = (first & 0xF, first & 1 << 7 != 0, first & 1 << 5 != 0);
    let memory = first & 0x0E00 == 0x0C00;
    if memory && base == SP && back {
        instruction = instruction.stack(moved(up, i32::from(second & 0xFF) * 4));
    }
    instruction
}

/// Arithmetic with constants.
fn immediate(first: u16, second: u16) -> Instruction {
    let (operand, register) = (first & 0xF, second >> 8 & 0xF);
    let twelve = (first >> 10 & 1) << 11 | (second >> 12 & 7) << 8 | second & 0xFF;
    let plain = Instruction::plain(4, 1 << register);
    let bytes = || -> Option<i32> {
        Some(match first & 0xFBE0 {
            0xF100 => -i32::try_from(expanded(twelve)).ok()?,
            0xF1A0 => i32::try_from(expanded(twelve)).ok()?,
            0xF200 => -i32::from(twelve),
            0xF2A0 => i32::from(twelve),
            _ => return None,
        })
    };
    match (first & 0xFBF0, register) {
        (_, SP) if operand == SP => plain.stack(bytes().map_or(Stack::Unknown, Stack::Deeper)),
        (_, SP) => plain.stack(Stack::Unknown),
        // With flags or without.
        (0xF040 | 0xF050, _) if operand == PC => {
            plain.holding(register, Constant::Whole(expanded(twelve)))
        }
        (0xF240, _) => plain.holding(register, Constant::Whole((operand << 12 | twelve).into())),
        (0xF2C0, _) => plain.holding(register, Constant::Upper(operand << 12 | twelve)),
        _ => plain,
    }
}

fn branch_or_control(address: u32, first: u16, second: u16) -> Instruction {
    let plain = Instruction::plain(4, 0);
    let pc = address.wrapping_add(4);
    match second & 0x5000 {
        0x5000 => {
            let target = pc.wrapping_add_signed(far(first, second));
            Instruction::plain(4, CHANGED_BY_CALLS).going(Flow::Call(target))
        }
        0x1000 => plain.going(Flow::Jump(pc.wrapping_add_signed(far(first, second)))),
        0x0000 if first >> 7 & 7 == 7 => control(first, second),
        0x0000 => {
            let distance = u32::from(first >> 10 & 1) << 19
                | u32::from(second >> 11 & 1) << 18
                | u32::from(second >> 13 & 1) << 17
                | u32::from(first & 0x3F) << 11
                | u32::from(second & 0x7FF);
            plain.going(Flow::Branch(pc.wrapping_add_signed(signed(distance, 20) * 2)))
        }
        _ => plain.going(Flow::Unknown),
    }
}

/// Special registers, barriers, hints, `udf.w`.
fn control(first: u16, second: u16) -> Instruction {
    const MSP: u16 = 8;
    /// The other stack pointer, and the selection between the two.
    const PSP_AND_CONTROL: [u16; 2] = [9, 20];

    let plain = Instruction::plain(4, 1 << (second >> 8 & 0xF));
    match first & 0xFFF0 {
        // Writes to special registers; they change no other register.
        0xF380 if second & 0xFF == MSP => {
            Instruction::plain(4, 0).stack(Stack::Change(first & 0xF))
        }
        0xF380 if PSP_AND_CONTROL.contains(&(second & 0xFF)) => plain.stack(Stack::Unknown),
        0xF7F0 if second & 0xF000 == 0xA000 => plain.going(Flow::Stop),
        _ => plain,
    }
}

/// Distance of `bl` and `b.w`.
fn far(first: u16, second: u16) -> i32 {
    let sign = first >> 10 & 1;
    let bit = |of: u16| u32::from(!(of ^ sign) & 1);
    let distance = u32::from(sign) << 23
        | bit(second >> 13) << 22
        | bit(second >> 11) << 21
        | u32::from(first & 0x3FF) << 11
        | u32::from(second & 0x7FF);
    signed(distance, 24) * 2
}

/// A constant of 12 bits as the processor expands it (A5.3.2).
fn expanded(twelve: u16) -> u32 {
    let byte = u32::from(twelve & 0xFF);
    match twelve >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte * 0x0101_0101,
        _ => (byte | 0x80).rotate_right((twelve >> 7).into()),
    }
}

fn if_then_len(op: u16) -> u8 {
    match (op & 0xF).trailing_zeros() {
        0 => 4,
        1 => 3,
        2 => 2,
        _ => 1,
    }
}

/// Bytes that a list of registers takes.
fn words(list: u16) -> i32 {
    list.count_ones().cast_signed() * 4
}

/// A base that has moved up leaves the stack shallower.
fn moved(up: bool, bytes: i32) -> Stack {
    Stack::Deeper(if up { -bytes } else { bytes })
}

fn extended(value: u16, bits: u32) -> i32 {
    signed(value.into(), bits)
}

fn signed(value: u32, bits: u32) -> i32 {
    (value << (32 - bits)).cast_signed() >> (32 - bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    // The values are what an assembler made of the text beside them.

    fn flow_at(address: u32, first: u16, second: u16) -> Flow {
        decode(address, first, second).flow
    }

    fn flow(first: u16, second: u16) -> Flow {
        flow_at(0x1000, first, second)
    }

    fn stack(first: u16, second: u16) -> Stack {
        decode(0x1000, first, second).stack
    }

    fn constant(address: u32, first: u16, second: u16) -> Option<(u16, Constant)> {
        decode(address, first, second).constant
    }

    #[test]
    fn a_halfword_tells_whether_another_one_follows() {
        for (first, wide) in
            [(0xE7EE, false), (0xDE00, false), (0xE92D, true), (0xF7FF, true), (0xF8DF, true)]
        {
            assert_eq!(is_wide(first), wide, "{first:04x}");
            assert_eq!(decode(0, first, 0).length, if wide { 4 } else { 2 });
        }
    }

    #[test]
    fn jumps_and_branches_lead_where_the_assembler_meant_them_to() {
        assert_eq!(flow_at(0x20, 0xE7EE, 0), Flow::Jump(0)); // b
        assert_eq!(flow_at(0x40, 0xF7FF, 0xBFDE), Flow::Jump(0)); // b.w
        assert_eq!(flow_at(0x50, 0xE036, 0), Flow::Jump(0xC0));
        assert_eq!(flow_at(0x98, 0xF07F, 0xBFB2), Flow::Jump(0x8_0000));
        assert_eq!(flow_at(0x60, 0xD0CE, 0), Flow::Branch(0)); // beq
        assert_eq!(flow_at(0x64, 0xD12C, 0), Flow::Branch(0xC0)); // bne
        assert_eq!(flow_at(0x70, 0xF43F, 0xAFC6), Flow::Branch(0)); // beq.w
        assert_eq!(flow_at(0x78, 0xF07F, 0xA7C2), Flow::Branch(0x8_0000)); // bne.w
        assert_eq!(flow_at(0x80, 0xB1F1, 0), Flow::Branch(0xC0)); // cbz r1
        assert_eq!(flow_at(0x84, 0xB9EF, 0), Flow::Branch(0xC2)); // cbnz r7
    }

    #[test]
    fn calls_and_returns() {
        assert_eq!(flow_at(0x88, 0xF7FF, 0xFFBA), Flow::Call(0)); // bl
        assert_eq!(flow_at(0x90, 0xF07F, 0xFFB6), Flow::Call(0x8_0000));
        assert_eq!(flow(0x4798, 0), Flow::CallRegister(3)); // blx r3
        assert_eq!(flow(0x4760, 0), Flow::JumpRegister(12)); // bx r12
        assert_eq!(flow(0x4770, 0), Flow::Return); // bx lr
        assert_eq!(flow(0x46F7, 0), Flow::Return); // mov pc, lr
        assert_eq!(flow(0xBD10, 0), Flow::Return); // pop {r4, pc}
        assert_eq!(flow(0xE8BD, 0x8110), Flow::Return); // pop.w {r4, r8, pc}
        assert_eq!(flow(0xF85D, 0xFB04), Flow::Return); // ldr pc, [sp], #4
        assert_eq!(flow(0xE8B0, 0x8006), Flow::Unknown); // ldm r0!, {r1, r2, pc}
        assert_eq!(flow(0xF8DF, 0xF008), Flow::JumpWord(0x100C)); // ldr.w pc, [pc, #8]
    }

    #[test]
    fn what_is_neither_jump_nor_call_goes_on() {
        let others = [
            (0xBF00, 0),      // nop
            (0xF3BF, 0x8F4F), // dsb
            (0xBEAB, 0),      // bkpt
            (0xB672, 0),      // cpsid i
            (0xF380, 0x8811), // msr basepri, r0
            (0xF3EF, 0x8008), // mrs r0, msp
            (0xF89F, 0xF004), // pld [pc, #4]
            (0xF8BF, 0x1004), // ldrh.w r1, [pc, #4]
            (0xAF03, 0),      // add r7, sp, #12
            (0x46E9, 0),      // mov r9, sp
            (0x9001, 0),      // str r0, [sp, #4]
            (0xE9CD, 0x0102), // strd r0, r1, [sp, #8]
            (0xED8D, 0x0B02), // vstr d0, [sp, #8]
            (0xE930, 0x0006), // ldmdb r0!, {r1, r2}
        ];
        for (first, second) in others {
            let instruction = decode(0x1000, first, second);
            assert_eq!(
                (instruction.flow, instruction.stack),
                (Flow::Next, Stack::Deeper(0)),
                "{first:04x}"
            );
        }
    }

    #[test]
    fn tables_faults_and_conditional_blocks() {
        assert_eq!(flow(0xE8DF, 0xF000), Flow::Table(1)); // tbb [pc, r0]
        assert_eq!(flow(0xE8DF, 0xF011), Flow::Table(2)); // tbh [pc, r1, lsl #1]
        assert_eq!(flow(0xDE00, 0), Flow::Stop); // udf
        assert_eq!(flow(0xF7F0, 0xA000), Flow::Stop); // udf.w
        let lengths = [(0xBF08, 1), (0xBF04, 2), (0xBF0C, 2), (0xBF03, 4)]; // it, itt, ite, ittte
        for (first, length) in lengths {
            assert_eq!(flow(first, 0), Flow::IfThen(length));
        }
    }

    #[test]
    fn every_way_to_move_the_stack_pointer_is_counted() {
        assert_eq!(stack(0xB510, 0), Stack::Deeper(8)); // push {r4, lr}
        assert_eq!(stack(0xE92D, 0x4110), Stack::Deeper(12)); // push.w {r4, r8, lr}
        assert_eq!(stack(0xBD10, 0), Stack::Deeper(-8)); // pop {r4, pc}
        assert_eq!(stack(0xE8BD, 0x8110), Stack::Deeper(-12)); // pop.w {r4, r8, pc}
        assert_eq!(stack(0xB084, 0), Stack::Deeper(16)); // sub sp, #16
        assert_eq!(stack(0xB004, 0), Stack::Deeper(-16)); // add sp, #16
        assert_eq!(stack(0xF5AD, 0x6D80), Stack::Deeper(1024)); // sub.w sp, sp, #1024
        assert_eq!(stack(0xF5AD, 0x6D7F), Stack::Deeper(4080)); // sub.w sp, sp, #4080
        assert_eq!(stack(0xF6AD, 0x7DFF), Stack::Deeper(4095)); // subw sp, sp, #4095
        assert_eq!(stack(0xF50D, 0x5D80), Stack::Deeper(-4096)); // add.w sp, sp, #4096
        assert_eq!(stack(0xF84D, 0x8D04), Stack::Deeper(4)); // str r8, [sp, #-4]!
        assert_eq!(stack(0xF85D, 0x8B04), Stack::Deeper(-4)); // ldr r8, [sp], #4
        assert_eq!(stack(0xF85D, 0xFB04), Stack::Deeper(-4)); // ldr pc, [sp], #4
        assert_eq!(stack(0xE96D, 0x0102), Stack::Deeper(8)); // strd r0, r1, [sp, #-8]!
        assert_eq!(stack(0xE8FD, 0x0102), Stack::Deeper(-8)); // ldrd r0, r1, [sp], #8
        assert_eq!(stack(0xED2D, 0x8B04), Stack::Deeper(16)); // vpush {d8, d9}
        assert_eq!(stack(0xECBD, 0x8B04), Stack::Deeper(-16)); // vpop {d8, d9}
        assert_eq!(stack(0xECBD, 0x0A03), Stack::Deeper(-12)); // vldmia sp!, {s0-s2}
    }

    #[test]
    fn a_stack_pointer_from_a_register_is_not_followed() {
        let moves = [
            (0x46BD, 0),      // mov sp, r7
            (0x44A5, 0),      // add sp, r4
            (0xEBAD, 0x0D04), // sub.w sp, sp, r4
            (0xF380, 0x8814), // msr control, r0
            (0xF8DF, 0xD008), // ldr.w sp, [pc, #8]
            (0xF8D0, 0xD008), // ldr.w sp, [r0, #8]
        ];
        for (first, second) in moves {
            assert_eq!(stack(first, second), Stack::Unknown, "{first:04x}");
        }
        assert_eq!(stack(0xF381, 0x8808), Stack::Change(1)); // msr msp, r1
    }

    #[test]
    fn constants_in_registers_are_seen() {
        assert_eq!(constant(0, 0xF241, 0x2C35), Some((12, Constant::Whole(0x1235)))); // movw r12, #0x1235
        assert_eq!(constant(0, 0xF6C0, 0x0C00), Some((12, Constant::Upper(0x0800)))); // movt r12, #0x800
        assert_eq!(constant(0, 0xF04F, 0x6300), Some((3, Constant::Whole(0x0800_0000)))); // mov.w r3, #…
        assert_eq!(constant(0, 0xF05F, 0x6300), Some((3, Constant::Whole(0x0800_0000)))); // movs.w r3, #…
        assert_eq!(constant(0, 0xF04F, 0x11FF), Some((1, Constant::Whole(0x00FF_00FF))));
        assert_eq!(constant(0, 0xF04F, 0x21FF), Some((1, Constant::Whole(0xFF00_FF00))));
        assert_eq!(constant(0, 0xF04F, 0x3101), Some((1, Constant::Whole(0x0101_0101))));
        assert_eq!(constant(0, 0xF44F, 0x317F), Some((1, Constant::Whole(0x3FC00))));
        assert_eq!(constant(0x1002, 0x4A04, 0), Some((2, Constant::WordAt(0x1014)))); // ldr r2, [pc, #16]
        assert_eq!(constant(0x1002, 0xF8DF, 0x9010), Some((9, Constant::WordAt(0x1014)))); // ldr.w r9, [pc, #16]
    }

    #[test]
    fn registers_that_change_are_named() {
        assert_eq!(decode(0, 0x2401, 0).changes, 1 << 4); // movs r4, #1
        assert_eq!(decode(0, 0x46E9, 0).changes, 1 << 9); // mov r9, sp
        assert_eq!(decode(0, 0xF7FF, 0xFFBA).changes, CHANGED_BY_CALLS); // bl
        let ldmdb = decode(0, 0xE930, 0x0006).changes; // ldmdb r0!, {r1, r2}
        assert_eq!(ldmdb, 0b111);
        assert_eq!(decode(0, 0xC306, 0).changes, 1 << 3); // stm r3!, {r1, r2}
    }

    #[test]
    fn floating_point_is_told_from_the_rest() {
        for (first, second, expected) in [
            (0xEE30, 0x0A81, true), // vadd.f32 s0, s1, s2
            (0xED90, 0x0B00, true), // vldr d0, [r0]
            (0xED2D, 0x8B04, true), // vpush {d8, d9}
            (0xE92D, 0x4110, false),
        ] {
            assert_eq!(decode(0, first, second).floating_point, expected, "{first:04x}");
        }
    }
}
