//! What `yaxpeax-arm` says of an instruction, in the terms of our own decoder.
//!
//! That decoder knows the `ARMv7` of application processors, of which ARMv7-M is a part. These
//! differences in its description are translated here:
//!
//! * It counts the distance of 16-bit conditional branches from the next instruction and all others
//!   from two instructions on; the manual counts all from there (A7.7.12, A7.7.21).
//! * It says of loads and stores with an index that is added afterwards that they do not write the
//!   base back. They always do (A7.7.43: `wback = (P == 0 || W == 1)`).
//! * It does not know the floating-point unit, which is coprocessors 10 and 11 (A6.1.1). The effect
//!   of a coprocessor instruction on the processor's registers does not depend on the coprocessor.
//!   So it is asked about another one.

use yaxpeax_arch::{Decoder, U8Reader};
use yaxpeax_arm::armv7::{ConditionCode, InstDecoder, Instruction, Opcode, Operand, Reg};

use crate::thumb::{Constant, Flow, Stack};

const SP: u16 = 13;
const LR: u16 = 14;
const PC: u16 = 15;

/// What both decoders can tell of an instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Theirs {
    /// The instruction as text.
    pub(super) text: String,
    pub(super) opcode: Opcode,
    pub(super) length: u32,
    pub(super) flow: Flow,
    pub(super) stack: Stack,
    pub(super) constant: Option<(u16, Constant)>,
    /// Registers that it writes, r0 in bit 0.
    pub(super) gives: u16,
    /// The base register that it writes back.
    pub(super) moves: Option<u16>,
}

impl Theirs {
    /// Decodes the instruction at an address; `None` when the other decoder knows no such
    /// instruction.
    pub(super) fn of(address: u32, first: u16, second: u16) -> Option<Theirs> {
        let second =
            if is_floating_point(first, second) { second & !0x0F00 | 0x0100 } else { second };
        let bytes = [first.to_le_bytes(), second.to_le_bytes()].concat();
        let instruction = InstDecoder::armv7_thumb().decode(&mut U8Reader::new(&bytes)).ok()?;
        Some(Theirs {
            text: instruction.to_string(),
            opcode: instruction.opcode,
            length: if instruction.wide { 4 } else { 2 },
            flow: flow(address, &instruction),
            stack: stack(&instruction),
            constant: constant(address, &instruction),
            gives: gives(&instruction),
            moves: moved_base(&instruction).map(|(base, _)| base),
        })
    }
}

/// Whether the instruction is for coprocessor 10 or 11.
fn is_floating_point(first: u16, second: u16) -> bool {
    first & 0xEC00 == 0xEC00 && second & 0x0E00 == 0x0A00
}

fn number(register: Reg) -> u16 {
    register.number().into()
}

/// The register that an operand is.
fn register(operand: Operand) -> Option<u16> {
    match operand {
        Operand::Reg(register) => Some(number(register)),
        _ => None,
    }
}

/// The base register that a load or store writes back, and by how many bytes it moves.
fn moved_base(instruction: &Instruction) -> Option<(u16, i32)> {
    let signed = |bytes: u16, up| if up { i32::from(bytes) } else { -i32::from(bytes) };
    let all = || instruction.operands.into_iter();
    let list = all().find_map(|operand| match operand {
        Operand::RegList(list) => Some(list),
        _ => None,
    });
    all().find_map(|operand| match (operand, instruction.opcode) {
        (Operand::RegDerefPreindexOffset(base, bytes, up, true), _)
        | (Operand::RegDerefPostindexOffset(base, bytes, up, _), _) => {
            Some((number(base), signed(bytes, up)))
        }
        (Operand::RegWBack(base, true), Opcode::LDM(up, ..) | Opcode::STM(up, ..)) => {
            Some((number(base), signed(words(list?), up)))
        }
        (Operand::RegWBack(base, true), _) => Some((number(base), 0)),
        (Operand::RegList(list), Opcode::POP) => Some((SP, signed(words(list), true))),
        (Operand::RegList(list), Opcode::PUSH) => Some((SP, signed(words(list), false))),
        _ => None,
    })
}

/// Bytes of the registers in a list.
fn words(list: u16) -> u16 {
    (0..16).filter(|register| list >> register & 1 == 1).map(|_| 4).sum()
}

/// How many of the first operands are written.
#[expect(clippy::match_same_arms, reason = "an arm for each kind")]
fn destinations(opcode: Opcode) -> usize {
    match opcode {
        Opcode::STR
        | Opcode::STRH
        | Opcode::STRB
        | Opcode::STRD
        | Opcode::STRT
        | Opcode::STRHT
        | Opcode::STRBT
        | Opcode::MCR(..)
        | Opcode::MCRR(..) => 0,
        Opcode::CMP | Opcode::CMN | Opcode::TST | Opcode::TEQ => 0,
        Opcode::BX | Opcode::BXJ | Opcode::BLX | Opcode::CBZ | Opcode::CBNZ => 0,
        // A load into the program counter is a hint to the memory here.
        Opcode::NOP | Opcode::PLD | Opcode::PLI => 0,
        Opcode::LDRD
        | Opcode::LDREXD
        | Opcode::MRRC(..)
        | Opcode::UMULL
        | Opcode::SMULL
        | Opcode::UMLAL
        | Opcode::SMLAL
        | Opcode::UMAAL
        | Opcode::SMLAL_halfword(..)
        | Opcode::SMLALD(_)
        | Opcode::SMLSLD(_) => 2,
        _ => 1,
    }
}

fn gives(instruction: &Instruction) -> u16 {
    let operands = instruction.operands;
    let named = operands.into_iter().take(destinations(instruction.opcode)).filter_map(register);
    let link = matches!(instruction.opcode, Opcode::BL | Opcode::BLX).then_some(LR);
    let listed = operands.into_iter().find_map(|operand| match (operand, instruction.opcode) {
        (Operand::RegList(list), Opcode::LDM(..) | Opcode::POP) => Some(list),
        _ => None,
    });
    named.chain(link).fold(listed.unwrap_or(0), |all, register| all | 1 << register)
}

fn stack(instruction: &Instruction) -> Stack {
    let sum = |sign: i32| match instruction.operands {
        [to, from, Operand::Imm32(bytes), Operand::Nothing]
            if (register(to), register(from)) == (Some(SP), Some(SP)) =>
        {
            i32::try_from(bytes).ok().map(|bytes| sign * bytes)
        }
        _ => None,
    };
    let deeper = match (instruction.opcode, moved_base(instruction)) {
        (Opcode::SUB, _) => sum(1),
        (Opcode::ADD, _) => sum(-1),
        (_, Some((SP, up))) => Some(-up),
        _ => None,
    };
    match deeper {
        Some(bytes) => Stack::Deeper(bytes),
        None if gives(instruction) >> SP & 1 == 1 => Stack::Unknown,
        None => Stack::Deeper(0),
    }
}

/// Where a branch leads.
fn target(address: u32, instruction: &Instruction) -> Option<u32> {
    let halfwords = instruction.operands.into_iter().find_map(|operand| match operand {
        Operand::BranchThumbOffset(halfwords) => Some(halfwords),
        _ => None,
    })?;
    let is_conditional = instruction.condition != ConditionCode::AL
        || matches!(instruction.opcode, Opcode::CBZ | Opcode::CBNZ);
    let from = if is_conditional && !instruction.wide { 2 } else { 4 };
    Some(address.wrapping_add(from).wrapping_add_signed(halfwords * 2))
}

fn flow(address: u32, instruction: &Instruction) -> Flow {
    let Instruction { opcode, operands, .. } = instruction;
    let through =
        |register| if register == LR { Flow::Return } else { Flow::JumpRegister(register) };
    match (opcode, operands, target(address, instruction)) {
        (Opcode::B, _, Some(target)) if instruction.condition == ConditionCode::AL => {
            Flow::Jump(target)
        }
        (Opcode::B | Opcode::CBZ | Opcode::CBNZ, _, Some(target)) => Flow::Branch(target),
        (Opcode::BL, _, Some(target)) => Flow::Call(target),
        (Opcode::BLX, [Operand::Reg(to), ..], _) => Flow::CallRegister(number(*to)),
        (Opcode::BX, [Operand::Reg(to), ..], _) => through(number(*to)),
        (Opcode::MOV, [to, Operand::Reg(from), Operand::Nothing, _], _)
            if register(*to) == Some(PC) =>
        {
            through(number(*from))
        }
        (Opcode::TBB, [Operand::RegDerefPreindexReg(base, ..), ..], _) if number(*base) == PC => {
            Flow::Table(1)
        }
        (Opcode::TBH, _, _) if has_base(operands, PC) => Flow::Table(2),
        (Opcode::UDF, ..) => Flow::Stop,
        (Opcode::IT, [_, Operand::Imm32(mask), ..], _) => {
            Flow::IfThen(u8::try_from(4 - mask.trailing_zeros()).unwrap_or(0))
        }
        _ if is_elsewhere(*opcode) => Flow::Unknown,
        _ if gives(instruction) >> PC & 1 == 1 => loaded(address, instruction),
        _ => Flow::Next,
    }
}

/// Whether an operand is memory at this base.
fn has_base(operands: &[Operand; 4], wanted: u16) -> bool {
    operands.iter().any(|operand| match operand {
        Operand::RegDerefPreindexReg(base, ..)
        | Operand::RegDerefPreindexRegShift(base, ..)
        | Operand::RegDerefPreindexOffset(base, ..)
        | Operand::RegDerefPostindexOffset(base, ..)
        | Operand::RegWBack(base, _) => number(*base) == wanted,
        _ => false,
    })
}

/// Whether its target depends on the processor's state.
fn is_elsewhere(opcode: Opcode) -> bool {
    matches!(
        opcode,
        Opcode::TBB | Opcode::TBH | Opcode::BLX | Opcode::BXJ | Opcode::RFE(..) | Opcode::ERET
    )
}

/// The flow of an instruction that writes the program counter.
fn loaded(address: u32, instruction: &Instruction) -> Flow {
    let from_stack = match instruction.opcode {
        Opcode::POP => true,
        Opcode::LDM(..) => has_base(&instruction.operands, SP),
        Opcode::LDR => moved_base(instruction).is_some_and(|(base, _)| base == SP),
        _ => false,
    };
    match literal(address, instruction) {
        Some(word) => Flow::JumpWord(word),
        None if from_stack => Flow::Return,
        None => Flow::Unknown,
    }
}

/// The address of the word beside the code that an instruction loads.
fn literal(address: u32, instruction: &Instruction) -> Option<u32> {
    match (instruction.opcode, instruction.operands) {
        (Opcode::LDR, [_, Operand::RegDerefPreindexOffset(base, bytes, up, false), ..])
            if number(base) == PC =>
        {
            let from = address.wrapping_add(4) & !3;
            Some(from.wrapping_add_signed(if up { i32::from(bytes) } else { -i32::from(bytes) }))
        }
        _ => None,
    }
}

fn constant(address: u32, instruction: &Instruction) -> Option<(u16, Constant)> {
    let to = register(instruction.operands[0])?;
    match (instruction.opcode, instruction.operands) {
        (Opcode::MOV, [_, Operand::Imm32(value), Operand::Nothing, _]) => {
            Some((to, Constant::Whole(value)))
        }
        (Opcode::MOVT, [_, Operand::Imm32(value), ..]) => {
            Some((to, Constant::Upper(u16::try_from(value).ok()?)))
        }
        (Opcode::LDR, _) if to != PC => {
            Some((to, Constant::WordAt(literal(address, instruction)?)))
        }
        _ => None,
    }
}
