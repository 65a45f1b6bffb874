//! One function, along all its paths: how deep the stack gets, and what is called at which depth.
//!
//! # Design
//! Every instruction is visited with the stack depth before it and with the known values of
//! registers. The depth must be the same on every path to an instruction, as compilers ensure. A
//! register is known if all paths agree on its value.
//!
//! # Tradeoffs
//! What cannot be followed is reported as trouble, which fails the check. Nothing is guessed.
//!
//! # Notes
//! A call that does not return ends its path. The caller of the walk says whether a called function
//! returns.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use crate::image::Image;
use crate::thumb::{Constant, Flow, Instruction, Stack, decode, is_wide};

/// The target of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Callee {
    Function(u32),
    /// A target that only the running program knows.
    Computed,
}

/// A call, or a jump to another function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Call {
    /// The address of the call.
    pub(crate) at: u32,
    /// Bytes of stack in use.
    pub(crate) depth: u32,
    pub(crate) callee: Callee,
}

/// Something that cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trouble {
    /// The stack pointer is set from a register.
    StackPointer,
    /// The stack is conditionally deeper, or deeper on one path than on another one.
    UnevenStack,
    /// A return with something left on the stack.
    UnevenReturn,
    /// A jump to an unknown target.
    Jump,
    /// A table branch without its table.
    Table,
    /// A path that leaves the function and leads to no other one.
    NoFunction,
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Trouble::StackPointer => "sets the stack pointer from a register",
            Trouble::UnevenStack => "has a depth of stack that depends on the path",
            Trouble::UnevenReturn => "returns with something left on the stack",
            Trouble::Jump => "jumps to an unknown target",
            Trouble::Table => "branches by a table that is missing",
            Trouble::NoFunction => "leaves the function but enters no other one",
        })
    }
}

/// What is known of one function.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Walk {
    /// The most bytes of stack that it uses itself.
    pub(crate) depth: u32,
    pub(crate) calls: BTreeSet<Call>,
    /// Whether it can return.
    pub(crate) returns: bool,
    /// Constants that it puts into registers.
    pub(crate) constants: BTreeSet<u32>,
    /// Whether it uses the floating-point unit.
    pub(crate) floating_point: bool,
    /// The start of another stack, on which it and everything that it calls run.
    pub(crate) other_stack: Option<u32>,
    pub(crate) troubles: Vec<(u32, Trouble)>,
}

/// What is known before an instruction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct State {
    depth: i32,
    registers: [Option<u32>; 16],
    other_stack: Option<u32>,
    /// How many instructions from here on are conditional, in an if-then block.
    conditional: u8,
}

impl State {
    /// The value of a register, if it is known.
    fn register(&self, register: u16) -> Option<u32> {
        self.registers.get(usize::from(register)).copied().flatten()
    }

    /// The function whose address a register holds.
    fn function_in(&self, register: u16) -> Option<u32> {
        self.register(register).map(|address| address & !1)
    }
}

/// Follows the function at `entry`. `returns` says whether another function returns.
pub(crate) fn walk(image: &Image, entry: u32, returns: &mut dyn FnMut(u32) -> bool) -> Walk {
    let end = image.functions.get(&entry).map_or(entry, |function| function.end);
    let (seen, due) = (BTreeMap::new(), BTreeSet::new());
    let (used_at, walk) = (None, Walk::default());
    let mut walker = Walker { image, entry, end, returns, seen, due, used_at, walk };
    walker.reach(entry, State::default());
    while let Some((address, state)) = walker.next() {
        walker.step(address, &state);
    }
    // What was in use before the change would be counted on the wrong stack.
    if let Some(at) = walker.used_at.filter(|_| walker.walk.other_stack.is_some()) {
        walker.trouble(at, Trouble::StackPointer);
    }
    walker.walk
}

struct Walker<'a> {
    image: &'a Image,
    entry: u32,
    end: u32,
    returns: &'a mut dyn FnMut(u32) -> bool,
    /// The state before each instruction that was reached.
    seen: BTreeMap<u32, State>,
    /// The instructions to visit, for the first time or again.
    due: BTreeSet<u32>,
    /// Where the original stack is in use.
    used_at: Option<u32>,
    walk: Walk,
}

impl Walker<'_> {
    fn trouble(&mut self, at: u32, trouble: Trouble) {
        if !self.walk.troubles.contains(&(at, trouble)) {
            self.walk.troubles.push((at, trouble));
        }
    }

    /// Notes a path to an instruction.
    fn reach(&mut self, address: u32, state: State) {
        let Some(known) = self.seen.get_mut(&address) else {
            self.seen.insert(address, state);
            self.due.insert(address);
            return;
        };
        let uneven = known.depth != state.depth || known.other_stack != state.other_stack;
        for (known, new) in known.registers.iter_mut().zip(state.registers) {
            if known.is_some() && *known != new {
                *known = None;
                self.due.insert(address);
            }
        }
        if uneven {
            self.trouble(address, Trouble::UnevenStack);
        }
    }

    fn next(&mut self) -> Option<(u32, State)> {
        let address = self.due.pop_first()?;
        Some((address, self.seen.get(&address)?.clone()))
    }

    /// Follows one instruction.
    fn step(&mut self, address: u32, before: &State) {
        let Some(instruction) = self.fetch(address) else {
            return self.trouble(address, Trouble::NoFunction);
        };
        let after = self.after(address, before, &instruction);
        self.walk.floating_point |= instruction.floating_point;
        self.walk.depth = self.walk.depth.max(after.depth.max(0).cast_unsigned());
        if after.depth > 0 && after.other_stack.is_none() {
            self.used_at.get_or_insert(address);
        }
        let next = address.saturating_add(instruction.length);
        // A conditional instruction may also be skipped.
        let mut goes_on = before.conditional > 0;
        match instruction.flow {
            Flow::Next | Flow::IfThen(_) => goes_on = true,
            Flow::Jump(target) => self.jump(address, target, &after),
            Flow::Branch(target) => {
                self.jump(address, target, &after);
                goes_on = true;
            }
            Flow::Call(target) => goes_on |= self.call(address, Callee::Function(target), &after),
            Flow::CallRegister(register) => {
                let callee =
                    before.function_in(register).map_or(Callee::Computed, Callee::Function);
                goes_on |= self.call(address, callee, &after);
            }
            Flow::JumpRegister(register) => {
                self.jump_away(address, before.function_in(register), &after);
            }
            Flow::JumpWord(word) => {
                self.jump_away(address, self.image.word(word).map(|word| word & !1), &after);
            }
            Flow::Table(entry_len) => self.jump_by_table(address, next, entry_len, &after),
            Flow::Return if after.depth != 0 => self.trouble(address, Trouble::UnevenReturn),
            Flow::Return => self.walk.returns = true,
            Flow::Stop => {}
            Flow::Unknown => self.trouble(address, Trouble::Jump),
        }
        if goes_on {
            // A return that was skipped leaves the stack unchanged.
            let moved = matches!(instruction.flow, Flow::Return);
            let depth = if moved { before.depth } else { after.depth };
            self.go_on(address, next, State { depth, ..after });
        }
    }

    fn fetch(&self, address: u32) -> Option<Instruction> {
        if !(self.entry..self.end).contains(&address) || !self.image.is_code(address) {
            return None;
        }
        let halfword = |address| self.image.bytes(address).map(u16::from_le_bytes);
        let first = halfword(address)?;
        let second = if is_wide(first) { halfword(address.saturating_add(2))? } else { 0 };
        Some(decode(address, first, second))
    }

    /// What is known after an instruction.
    fn after(&mut self, address: u32, before: &State, instruction: &Instruction) -> State {
        let mut state = before.clone();
        self.move_stack(address, &mut state, instruction);
        for (register, value) in state.registers.iter_mut().enumerate() {
            if instruction.changes >> register & 1 == 1 {
                *value = None;
            }
        }
        if let Some((register, constant)) = instruction.constant {
            let value = self.value(constant, before.register(register));
            self.walk.constants.extend(value);
            if let Some(known) = state.registers.get_mut(usize::from(register)) {
                *known = value.filter(|_| before.conditional == 0);
            }
        }
        state.conditional = match instruction.flow {
            Flow::IfThen(count) => count,
            _ => before.conditional.saturating_sub(1),
        };
        state
    }

    fn move_stack(&mut self, address: u32, state: &mut State, instruction: &Instruction) {
        let conditional = state.conditional > 0;
        match instruction.stack {
            Stack::Deeper(0) => {}
            // A conditional `pop {pc}` is allowed: `step` handles it where it follows returns.
            Stack::Deeper(_) if conditional && instruction.flow != Flow::Return => {
                self.trouble(address, Trouble::UnevenStack);
            }
            Stack::Deeper(bytes) => state.depth = state.depth.saturating_add(bytes),
            Stack::Change(register) => match state.register(register).filter(|_| !conditional) {
                Some(top) => {
                    (state.depth, state.other_stack) = (0, Some(top));
                    self.walk.other_stack = Some(top);
                }
                None => self.trouble(address, Trouble::StackPointer),
            },
            Stack::Unknown => self.trouble(address, Trouble::StackPointer),
        }
    }

    fn value(&self, constant: Constant, before: Option<u32>) -> Option<u32> {
        match constant {
            Constant::Whole(value) => Some(value),
            Constant::Upper(upper) => before.map(|before| before & 0xFFFF | u32::from(upper) << 16),
            Constant::WordAt(word) => self.image.word(word),
        }
    }

    /// Continues at the next instruction.
    fn go_on(&mut self, address: u32, next: u32, state: State) {
        if next < self.end {
            self.reach(next, state);
        } else {
            self.trouble(address, Trouble::NoFunction);
        }
    }

    fn jump(&mut self, address: u32, target: u32, state: &State) {
        if (self.entry..self.end).contains(&target) {
            self.reach(target, State { conditional: 0, ..state.clone() });
        } else {
            self.jump_away(address, Some(target), state);
        }
    }

    /// Follows a call whose return is that of the caller.
    fn jump_away(&mut self, address: u32, target: Option<u32>, state: &State) {
        match target {
            Some(target) if self.image.functions.contains_key(&target) => {
                let comes_back = self.call(address, Callee::Function(target), state);
                if comes_back && state.depth != 0 {
                    self.trouble(address, Trouble::UnevenReturn);
                }
                self.walk.returns |= comes_back;
            }
            Some(_) => self.trouble(address, Trouble::NoFunction),
            // Calls in tail position through a pointer are compiled to this.
            None if state.depth == 0 => {
                self.walk.returns |= self.call(address, Callee::Computed, state);
            }
            None => self.trouble(address, Trouble::Jump),
        }
    }

    /// Notes a call and returns whether it returns.
    fn call(&mut self, at: u32, callee: Callee, state: &State) -> bool {
        let depth = state.depth.max(0).cast_unsigned();
        if state.other_stack.is_none() {
            self.used_at.get_or_insert(at);
        }
        self.walk.calls.insert(Call { at, depth, callee });
        match callee {
            Callee::Function(target) if self.image.functions.contains_key(&target) => {
                (self.returns)(target)
            }
            Callee::Function(_) => {
                self.trouble(at, Trouble::NoFunction);
                true
            }
            Callee::Computed => true,
        }
    }

    /// Follows a table branch. Distances are in halfwords from the end of the instruction, where
    /// the table begins.
    fn jump_by_table(&mut self, address: u32, table: u32, entry_len: u32, state: &State) {
        let end = self.image.code_after(table).filter(|_| !self.image.is_code(table));
        let Some(end) = end.filter(|&end| end <= self.end) else {
            return self.trouble(address, Trouble::Table);
        };
        for at in (table..end).step_by(entry_len as usize) {
            let entry: Option<u32> = match entry_len {
                1 => self.image.bytes(at).map(|[byte]| u32::from(byte)),
                _ => self.image.bytes(at).map(|bytes| u16::from_le_bytes(bytes).into()),
            };
            let Some(entry) = entry else { return self.trouble(address, Trouble::Table) };
            let target = table.saturating_add(entry * 2);
            // A last byte may only pad the table to an even length.
            let filler = entry_len == 1 && end - at == 1 && !(end..self.end).contains(&target);
            if !filler {
                self.jump(address, target, state);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UDF: u16 = 0xDE00;
    const BX_LR: u16 = 0x4770;
    const PUSH_R4_LR: u16 = 0xB510;
    const POP_R4_PC: u16 = 0xBD10;
    const SUB_SP_16: u16 = 0xB084;
    const ADD_SP_16: u16 = 0xB004;
    const NOP: u16 = 0xBF00;

    const AT: u32 = 0x100;

    fn walk_first(image: &Image) -> Walk {
        walk(image, AT, &mut |_| true)
    }

    fn walk_code(code: &[u16]) -> Walk {
        walk_first(&Image::of_functions(AT, &[("f", code)]))
    }

    fn call(at: u32, depth: u32, target: u32) -> Call {
        Call { at, depth, callee: Callee::Function(target) }
    }

    #[test]
    fn a_leaf_uses_no_stack() {
        let walk = walk_code(&[NOP, BX_LR]);
        assert_eq!(walk, Walk { returns: true, ..Walk::default() });
    }

    #[test]
    fn the_deepest_of_all_paths_counts() {
        // cbz r1, +2; sub sp; add sp; on all paths: push, pop
        let walk = walk_code(&[0xB109, SUB_SP_16, ADD_SP_16, PUSH_R4_LR, POP_R4_PC]);
        assert_eq!((walk.depth, walk.returns, &walk.troubles[..]), (16, true, &[][..]));
    }

    #[test]
    fn a_call_is_noted_with_the_depth_at_which_it_stands() {
        // push; bl g; sub sp; bl g; add sp; pop
        let image = Image::of_functions(
            AT,
            &[
                (
                    "f",
                    &[PUSH_R4_LR, 0xF000, 0xF805, SUB_SP_16, 0xF000, 0xF802, ADD_SP_16, POP_R4_PC],
                ),
                ("g", &[BX_LR]),
            ],
        );
        let walk = walk_first(&image);
        assert_eq!(walk.calls, BTreeSet::from([call(0x102, 8, 0x110), call(0x108, 24, 0x110)]));
        assert_eq!((walk.depth, walk.returns, walk.troubles), (24, true, vec![]));
    }

    #[test]
    fn a_call_that_never_comes_back_ends_its_path() {
        // push; bl g, and then another function
        let image = Image::of_functions(AT, &[("f", &[PUSH_R4_LR, 0xF000, 0xF800]), ("g", &[UDF])]);
        let walk = walk(&image, AT, &mut |function| function != 0x106);
        assert_eq!((walk.returns, walk.troubles), (false, vec![]));
        assert_eq!(walk_first(&image).troubles, [(0x102, Trouble::NoFunction)]);
    }

    #[test]
    fn a_jump_to_a_function_is_a_call_in_the_place_of_the_return() {
        // push {r4, lr}; pop.w {r4, lr}; b.w g
        let code = [PUSH_R4_LR, 0xE8BD, 0x4010, 0xF000, 0xB800];
        let image = Image::of_functions(AT, &[("f", &code), ("g", &[BX_LR])]);
        let walk = walk_first(&image);
        assert_eq!(walk.calls, BTreeSet::from([call(0x106, 0, 0x10A)]));
        assert_eq!((walk.depth, walk.returns, walk.troubles), (8, true, vec![]));
    }

    #[test]
    fn a_jump_to_what_is_no_function_is_trouble() {
        let image = Image::of_functions(AT, &[("f", &[0xE001]), ("g", &[NOP, NOP, BX_LR])]); // b g+4
        assert_eq!(walk_first(&image).troubles, [(AT, Trouble::NoFunction)]);
    }

    #[test]
    fn a_table_leads_to_all_its_entries() {
        // tbb [pc, r0] over (2, 3, 2, filler); bx lr; sub; add; bx lr
        let code = [0xE8DF, 0xF000, 0x0302, 0x0002, BX_LR, SUB_SP_16, ADD_SP_16, BX_LR];
        let image = Image::of_functions(AT, &[("f", &code)]);
        assert_eq!(walk_first(&image).troubles, [(AT, Trouble::Table)]);
        let walk = walk_first(&image.with_data(0x104, 0x108));
        assert_eq!((walk.depth, walk.returns, walk.troubles), (16, true, vec![]));

        // tbh [pc, r0, lsl #1] over (2, 3)
        let code = [0xE8DF, 0xF010, 2, 3, BX_LR, SUB_SP_16, ADD_SP_16, BX_LR];
        let walk = walk_first(&Image::of_functions(AT, &[("f", &code)]).with_data(0x104, 0x108));
        assert_eq!((walk.depth, walk.returns, walk.troubles), (16, true, vec![]));
    }

    #[test]
    fn a_call_through_a_register_that_holds_a_constant_is_a_call_like_any_other() {
        // movw r12, #0x10B; movt r12, #0; bx r12
        let code = [0xF240, 0x1C0B, 0xF2C0, 0x0C00, 0x4760];
        let walk = walk_first(&Image::of_functions(AT, &[("f", &code), ("g", &[BX_LR])]));
        assert_eq!(walk.calls, BTreeSet::from([call(0x108, 0, 0x10A)]));
        assert_eq!((walk.returns, walk.troubles), (true, vec![]));
        // The same, but the target is not a function.
        assert_eq!(walk_code(&code).troubles, [(0x108, Trouble::NoFunction)]);

        // push; ldr r3, [pc, #4]; blx r3; pop; the word 0801_0101h
        let code = [PUSH_R4_LR, 0x4B01, 0x4798, POP_R4_PC, 0x0101, 0x0800];
        let walk = walk_code(&code);
        assert_eq!(walk.calls, BTreeSet::from([call(0x104, 8, 0x0800_0100)]));
        assert_eq!(walk.constants, BTreeSet::from([0x0800_0101]));
    }

    #[test]
    fn a_register_that_differs_between_paths_is_not_known() {
        // mov.w r3, #0x100; cbz r0, +2; movs r3, #1; push; blx r3; pop
        let code = [0xF44F, 0x7380, 0xB100, 0x2301, PUSH_R4_LR, 0x4798, POP_R4_PC];
        let callees: Vec<_> = walk_code(&code).calls.iter().map(|call| call.callee).collect();
        assert!(callees.contains(&Callee::Computed), "{callees:?}");
    }

    #[test]
    fn a_call_that_only_the_running_program_knows_is_noted_as_such() {
        let computed = |at, depth| BTreeSet::from([Call { at, depth, callee: Callee::Computed }]);
        assert_eq!(walk_code(&[PUSH_R4_LR, 0x4780, POP_R4_PC]).calls, computed(0x102, 8)); // blx r0
        assert_eq!(walk_code(&[0x4700]).calls, computed(0x100, 0)); // bx r0
    }

    #[test]
    fn a_conditional_return_leaves_the_stack_as_it_is_for_those_who_stay() {
        // push; cmp; it eq; popeq {r4, pc}; sub; add; pop
        let walk =
            walk_code(&[PUSH_R4_LR, 0x2800, 0xBF08, POP_R4_PC, SUB_SP_16, ADD_SP_16, POP_R4_PC]);
        assert_eq!((walk.depth, walk.returns, walk.troubles), (24, true, vec![]));
    }

    #[test]
    fn a_stack_that_cannot_be_followed_is_trouble() {
        let troubles = |code: &[u16]| walk_code(code).troubles;
        assert_eq!(troubles(&[0x46BD, BX_LR]), [(AT, Trouble::StackPointer)]); // mov sp, r7
        assert_eq!(troubles(&[SUB_SP_16, BX_LR]), [(0x102, Trouble::UnevenReturn)]);
        assert_eq!(troubles(&[0xBF08, SUB_SP_16, BX_LR]), [(0x102, Trouble::UnevenStack)]); // it eq
        assert_eq!(troubles(&[SUB_SP_16, 0xE7FD, BX_LR]), [(AT, Trouble::UnevenStack)]); // b f
        assert_eq!(troubles(&[NOP]), [(AT, Trouble::NoFunction)]);
    }

    #[test]
    fn a_handler_may_change_to_a_stack_of_its_own_before_it_uses_any() {
        // movw r1, #0x400; movt r1, #0x2000; msr msp, r1; push; pop
        let code = [0xF240, 0x4100, 0xF2C2, 0x0100, 0xF381, 0x8808, PUSH_R4_LR, POP_R4_PC];
        let walk = walk_code(&code);
        assert_eq!((walk.other_stack, walk.depth, walk.troubles), (Some(0x2000_0400), 8, vec![]));
        // The same after a push: the pushed registers are on the first stack.
        let code = [&[PUSH_R4_LR], &code[..]].concat();
        assert_eq!(walk_code(&code).troubles, [(AT, Trouble::StackPointer)]);
        // msr msp, r1 with any value
        assert_eq!(walk_code(&[0xF381, 0x8808, BX_LR]).troubles, [(AT, Trouble::StackPointer)]);
    }

    #[test]
    fn a_loop_is_followed_once() {
        // subs r0, #1; bne; bx lr
        assert_eq!(walk_code(&[0x3801, 0xD1FD, BX_LR]), Walk { returns: true, ..Walk::default() });
    }
}
