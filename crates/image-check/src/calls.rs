//! All reachable functions, and how deep the stack gets below each.
//!
//! # Design
//! A call counts with the stack depth at which it is made. The deepest path is therefore the sum of
//! what is in use at each call, not of whole frames.
//!
//! # Tradeoffs
//! A call through a pointer is assumed to lead to any function whose address the image holds
//! somewhere: these may be too many, but never too few. Recursion has no bound that could be found
//! here, so it fails the check.

use std::collections::{BTreeMap, BTreeSet};

use crate::image::{Image, VECTOR_TABLE};
use crate::walk::{Call, Callee, Walk, walk};

/// How many nested calls are followed: ten times as many as a program for a board has. Deeper
/// nesting is refused before it overflows the stack of this program.
const DEEPEST: usize = 200;

/// The functions of an image and their calls.
pub(crate) struct Calls<'a> {
    image: &'a Image,
    walks: BTreeMap<u32, Walk>,
    /// Functions that a pointer may lead to.
    pointed_to: BTreeSet<u32>,
}

/// The deepest path from a function.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Deepest {
    /// Bytes of stack.
    pub(crate) bytes: u32,
    /// The functions on the path, the first one included.
    pub(crate) path: Vec<u32>,
    /// The start of the stack to which the first function changes; `None` if it stays on the stack
    /// that it found.
    pub(crate) other_stack: Option<u32>,
}

/// Why the depth is unbounded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Unbounded {
    /// The functions of a ring of calls.
    Recursion(Vec<u32>),
    /// An instruction that could not be followed; the walk of its function says why.
    NotFollowed(u32),
    /// A function that is nested too deeply to follow.
    TooDeep(u32),
}

impl<'a> Calls<'a> {
    /// Walks all functions of an image. Calls of functions in `without` are left out.
    pub(crate) fn of(image: &'a Image, without: &BTreeSet<u32>) -> Calls<'a> {
        let mut calls = Calls { image, walks: BTreeMap::new(), pointed_to: BTreeSet::new() };
        let mut begun = BTreeSet::new();
        for &function in image.functions.keys() {
            calls.returns(function, &mut begun, 0);
        }
        calls.pointed_to = pointers(image, &calls.walks);
        let left_out = |call: &Call| matches!(call.callee, Callee::Function(target) if without.contains(&target));
        calls.walks.values_mut().for_each(|walk| walk.calls.retain(|call| !left_out(call)));
        calls
    }

    /// Walks a function unless that has been done, and returns whether it returns. A function that
    /// is nested too deeply is walked later and assumed to return.
    fn returns(&mut self, function: u32, begun: &mut BTreeSet<u32>, depth: usize) -> bool {
        if depth < DEEPEST && begun.insert(function) {
            let walk =
                walk(self.image, function, &mut |callee| self.returns(callee, begun, depth + 1));
            self.walks.insert(function, walk);
        }
        // A function whose walk is unfinished is part of a recursion, which fails anyway.
        self.walks.get(&function).is_none_or(|walk| walk.returns)
    }

    /// The walk of a function.
    pub(crate) fn walk(&self, function: u32) -> Option<&Walk> {
        self.walks.get(&function)
    }

    /// All functions with their walks.
    pub(crate) fn walks(&self) -> impl Iterator<Item = (u32, &Walk)> {
        self.walks.iter().map(|(&function, walk)| (function, walk))
    }

    /// Where a call may lead.
    pub(crate) fn targets(&self, call: &Call) -> impl Iterator<Item = u32> {
        let (one, any) = match call.callee {
            Callee::Function(function) => (Some(function), None),
            Callee::Computed => (None, Some(self.pointed_to.iter().copied())),
        };
        one.into_iter().chain(any.into_iter().flatten())
    }

    /// The functions that can be reached from `from`, including those.
    pub(crate) fn reachable(&self, from: impl IntoIterator<Item = u32>) -> BTreeSet<u32> {
        let mut reached = BTreeSet::new();
        let mut due: Vec<u32> = from.into_iter().collect();
        while let Some(function) = due.pop() {
            if reached.insert(function) {
                let calls = self.walks.get(&function).into_iter().flat_map(|walk| &walk.calls);
                due.extend(calls.flat_map(|call| self.targets(call)));
            }
        }
        reached
    }

    /// The calls of a function.
    pub(crate) fn calls_of(&self, function: u32) -> impl Iterator<Item = &Call> {
        let calls = self.walks.values().flat_map(|walk| &walk.calls);
        calls.filter(move |call| call.callee == Callee::Function(function))
    }

    /// The deepest path from a function.
    ///
    /// # Errors
    /// If there is a recursion on a path, or an instruction that could not be followed.
    pub(crate) fn deepest(&self, from: u32) -> Result<Deepest, Unbounded> {
        self.deepest_from(from, &mut BTreeMap::new(), &mut Vec::new())
    }

    fn deepest_from(
        &self,
        function: u32,
        known: &mut BTreeMap<u32, Deepest>,
        on_the_way: &mut Vec<u32>,
    ) -> Result<Deepest, Unbounded> {
        if let Some(deepest) = known.get(&function) {
            return Ok(deepest.clone());
        }
        if let Some(begin) = on_the_way.iter().position(|&caller| caller == function) {
            return Err(Unbounded::Recursion(on_the_way.split_off(begin)));
        }
        if on_the_way.len() >= DEEPEST {
            return Err(Unbounded::TooDeep(function));
        }
        let walk = self.walks.get(&function).ok_or(Unbounded::NotFollowed(function))?;
        if let Some(&(at, _)) = walk.troubles.first() {
            return Err(Unbounded::NotFollowed(at));
        }
        if walk.other_stack.is_some() && !on_the_way.is_empty() {
            return Err(Unbounded::NotFollowed(function));
        }
        on_the_way.push(function);
        let mut deepest =
            Deepest { bytes: walk.depth, path: vec![function], other_stack: walk.other_stack };
        for call in &walk.calls {
            for target in self.targets(call) {
                let below = self.deepest_from(target, known, on_the_way)?;
                let bytes = call.depth.saturating_add(below.bytes);
                if bytes > deepest.bytes {
                    deepest.bytes = bytes;
                    deepest.path.truncate(1);
                    deepest.path.extend(below.path);
                }
            }
        }
        on_the_way.pop();
        known.insert(function, deepest.clone());
        Ok(deepest)
    }

    /// A text that says why the depth is unbounded.
    pub(crate) fn explain(&self, unbounded: &Unbounded) -> String {
        match unbounded {
            Unbounded::Recursion(ring) => {
                let names: Vec<_> =
                    ring.iter().chain(ring.first()).map(|&at| self.image.name_of(at)).collect();
                format!("recursion: {}", names.join(" → "))
            }
            Unbounded::TooDeep(at) => {
                format!("{} is nested deeper than any program", self.image.name_of(*at))
            }
            Unbounded::NotFollowed(at) => {
                let troubles = self.walks.values().flat_map(|walk| &walk.troubles);
                let what = troubles.into_iter().find(|(place, _)| place == at);
                let what = what.map_or(
                    "is no function, or one that changes the stack".to_owned(),
                    |(_, trouble)| trouble.to_string(),
                );
                format!("{} ({at:#x}) {what}", self.image.name_of(*at))
            }
        }
    }
}

/// Functions whose address is in data or is put into a register. The vector table does not count,
/// because only the processor uses it.
fn pointers(image: &Image, walks: &BTreeMap<u32, Walk>) -> BTreeSet<u32> {
    let mut values: BTreeSet<u32> =
        walks.values().flat_map(|walk| walk.constants.iter().copied()).collect();
    for piece in
        image.pieces.iter().filter(|piece| piece.name != VECTOR_TABLE && !piece.bytes.is_empty())
    {
        let places =
            piece.addresses().filter(|address| address % 4 == 0 && !image.is_code(*address));
        values.extend(places.filter_map(|address| image.word(address)));
    }
    let entry = |value: u32| Some(value & !1).filter(|_| value & 1 == 1);
    values
        .into_iter()
        .filter_map(entry)
        .filter(|entry| image.functions.contains_key(entry))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: u32 = 0x100;
    const PUSH: u16 = 0xB510; // {r4, lr}
    const POP: u16 = 0xBD10; // {r4, pc}
    const BX_LR: u16 = 0x4770;
    const SUB_SP_64: u16 = 0xB090;
    const ADD_SP_64: u16 = 0xB010;

    /// Second halfword of a `bl` over this many halfwords from its end.
    const fn bl(halfwords: u16) -> u16 {
        0xF800 | halfwords
    }

    fn bytes_and_names(calls: &Calls<'_>, from: u32) -> (u32, Vec<String>) {
        let deepest = calls.deepest(from).unwrap();
        (deepest.bytes, deepest.path.iter().map(|&at| calls.image.name_of(at)).collect())
    }

    #[test]
    fn the_deepest_path_adds_what_is_in_use_at_each_call() {
        // main: push; bl shallow; sub; bl leaf; add; pop. shallow: push; bl leaf; pop.
        let image = Image::of_functions(
            AT,
            &[
                ("main", &[PUSH, 0xF000, bl(5), SUB_SP_64, 0xF000, bl(6), ADD_SP_64, POP]),
                ("shallow", &[PUSH, 0xF000, bl(1), POP]),
                ("leaf", &[PUSH, POP]),
            ],
        );
        let calls = Calls::of(&image, &BTreeSet::new());
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
        assert_eq!(bytes_and_names(&calls, AT), (80, names(&["main", "leaf"])));
        assert_eq!(bytes_and_names(&calls, 0x110), (16, names(&["shallow", "leaf"])));
        assert_eq!(calls.reachable([0x110]), BTreeSet::from([0x110, 0x118]));
        assert_eq!(calls.calls_of(0x118).map(|call| call.at).collect::<Vec<_>>(), [0x108, 0x112]);
    }

    #[test]
    fn recursion_has_no_bound_and_is_told() {
        // f: push; bl g; pop. g: push; bl f; pop.
        let image = Image::of_functions(
            AT,
            &[("f", &[PUSH, 0xF000, bl(1), POP]), ("g", &[PUSH, 0xF7FF, 0xFFF9, POP])],
        );
        let calls = Calls::of(&image, &BTreeSet::new());
        let unbounded = calls.deepest(AT).unwrap_err();
        assert_eq!(unbounded, Unbounded::Recursion(vec![0x100, 0x108]));
        assert_eq!(calls.explain(&unbounded), "recursion: f → g → f");
    }

    #[test]
    fn a_call_through_a_pointer_may_lead_to_every_function_that_is_pointed_to() {
        // f: push; blx r0; pop; nop; addresses of `deep` and, even and thus no function's, of
        // `other`.
        let image = Image::of_functions(
            AT,
            &[
                ("f", &[PUSH, 0x4780, POP, 0xBF00, 0x0111, 0, 0x0118, 0]),
                ("deep", &[SUB_SP_64, ADD_SP_64, BX_LR, 0xBF00]),
                ("other", &[SUB_SP_64, SUB_SP_64, ADD_SP_64, ADD_SP_64, BX_LR]),
            ],
        );
        let image = image.with_data(0x108, 0x110);
        let calls = Calls::of(&image, &BTreeSet::new());
        assert_eq!(bytes_and_names(&calls, AT), (72, vec!["f".to_owned(), "deep".to_owned()]));
    }

    #[test]
    fn what_cannot_be_followed_has_no_depth_either() {
        // f: push; bl g; pop. g: mov sp, r7; bx lr.
        let image =
            Image::of_functions(AT, &[("f", &[PUSH, 0xF000, bl(1), POP]), ("g", &[0x46BD, BX_LR])]);
        let calls = Calls::of(&image, &BTreeSet::new());
        let unbounded = calls.deepest(AT).unwrap_err();
        assert_eq!(unbounded, Unbounded::NotFollowed(0x108));
        assert_eq!(calls.explain(&unbounded), "g (0x108) sets the stack pointer from a register");
    }

    #[test]
    fn a_call_into_what_never_comes_back_is_the_end_of_its_caller() {
        // f: push; bl stop. stop: udf.
        let image = Image::of_functions(AT, &[("f", &[PUSH, 0xF000, bl(0)]), ("stop", &[0xDE00])]);
        let calls = Calls::of(&image, &BTreeSet::new());
        assert_eq!(bytes_and_names(&calls, AT).0, 8);
        assert!(!calls.walk(AT).unwrap().returns);
    }

    #[test]
    fn calls_that_are_left_out_count_for_nothing() {
        // f: push; bl f; pop
        let image = Image::of_functions(
            AT,
            &[("main", &[0xF000, bl(2), BX_LR, 0xBF00]), ("f", &[PUSH, 0xF7FF, 0xFFFD, POP])],
        );
        let f = image.function("f").unwrap();
        let calls = Calls::of(&image, &BTreeSet::from([f]));
        assert_eq!(calls.deepest(AT), Ok(Deepest { bytes: 0, path: vec![AT], other_stack: None }));
    }
}
