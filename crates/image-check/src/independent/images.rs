//! Every instruction of the images. `cargo xtask test` builds them and tells the tests their paths.

use std::collections::BTreeSet;
use std::path::Path;

use super::{Verdict, compare};
use crate::calls::Calls;
use crate::image::Image;
use crate::thumb::{Flow, Instruction, Stack, decode, is_wide};

/// An instruction and its address.
struct Placed {
    at: u32,
    first: u16,
    second: u16,
}

impl Placed {
    fn ours(&self) -> Instruction {
        decode(self.at, self.first, self.second)
    }
}

/// All functions of an image, instruction by instruction, whether or not they can be reached. The
/// linker's fillers are left out.
fn sweep(image: &Image) -> Vec<Placed> {
    let halfword = |at| image.bytes(at).map(u16::from_le_bytes);
    let is_code = |at| image.is_code(at) && image.function_around(at).is_some();
    let mut all = Vec::new();
    for piece in &image.pieces {
        let mut at = piece.address;
        while piece.addresses().contains(&at) {
            let Some(first) = halfword(at).filter(|_| is_code(at)) else {
                at += 2;
                continue;
            };
            let second = if is_wide(first) { halfword(at + 2).unwrap_or(0) } else { 0 };
            let placed = Placed { at, first, second };
            at += placed.ours().length;
            all.push(placed);
        }
    }
    all
}

/// Compares our decoder with the other one, and the walk with the starts of instructions.
fn hold(variable: &str) {
    let file = std::env::var_os(variable);
    let file = file.unwrap_or_else(|| panic!("{variable} is not set: run `cargo xtask test`"));
    let image = Image::read(Path::new(&file)).unwrap_or_else(|error| panic!("{error}"));
    let all = sweep(&image);

    let mut wrong = Vec::new();
    for placed in &all {
        match compare(placed.at, placed.first, placed.second) {
            Verdict::Agreed | Verdict::Accepted(_) => {}
            Verdict::Unknown if reads_special_register(placed) => {}
            Verdict::Unknown => {
                wrong.push(format!("{:04x} {:04x}: unknown", placed.first, placed.second));
            }
            Verdict::Differs(how) => wrong.push(how),
        }
    }
    assert!(wrong.is_empty(), "{} differences:\n{}", wrong.len(), wrong.join("\n"));
    assert_is_a_program(&all);
    assert_walk_keeps_to(&image, &all);
}

/// Whether the other decoder does not know this instruction because ARMv7-M has other special
/// registers (B5.1.1). Ours must read it as the manual does: one register changes (A7.7.82).
fn reads_special_register(placed: &Placed) -> bool {
    let ours = placed.ours();
    let plain = (ours.length, ours.flow, ours.stack, ours.constant)
        == (4, Flow::Next, Stack::Deeper(0), None);
    let changes = 1 << (placed.second >> 8 & 0xF);
    placed.first == 0xF3EF && placed.second & 0xF000 == 0x8000 && plain && ours.changes == changes
}

/// Checks that the sweep has met every kind of instruction that the walk depends on.
fn assert_is_a_program(all: &[Placed]) {
    let count =
        |is: fn(&Instruction) -> bool| all.iter().filter(|placed| is(&placed.ours())).count();
    let calls = count(|instruction| matches!(instruction.flow, Flow::Call(_)));
    let branches = count(|instruction| matches!(instruction.flow, Flow::Branch(_) | Flow::Jump(_)));
    let returns = count(|instruction| instruction.flow == Flow::Return);
    let moves = count(|instruction| instruction.stack != Stack::Deeper(0));
    let constants = count(|instruction| instruction.constant.is_some());
    println!(
        "{} instructions: {calls} calls, {branches} branches, {returns} returns, \
         {moves} of the stack pointer, {constants} constants",
        all.len()
    );
    assert!(all.len() > 5000);
    for least in [calls, branches, returns, moves, constants] {
        assert!(least > 100);
    }
}

/// Checks that an instruction begins wherever the walk finds a call, and at every target.
fn assert_walk_keeps_to(image: &Image, all: &[Placed]) {
    let begins: BTreeSet<u32> = all.iter().map(|placed| placed.at).collect();
    let calls = Calls::of(image, &BTreeSet::new());
    let found: BTreeSet<u32> =
        calls.walks().flat_map(|(_, walk)| &walk.calls).map(|call| call.at).collect();
    assert!(found.is_subset(&begins), "{:x?}", found.difference(&begins));
    for placed in all {
        let (Flow::Jump(target) | Flow::Branch(target) | Flow::Call(target)) = placed.ours().flow
        else {
            continue;
        };
        assert!(begins.contains(&target), "{:#x} leads to {target:#x}", placed.at);
    }
    let entries: BTreeSet<u32> = image.functions.keys().copied().collect();
    assert!(entries.is_subset(&begins), "{:x?}", entries.difference(&begins));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_of_mps2_an385() {
    hold("SER_IMAGE_MPS2_AN385");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn image_of_stm32f407() {
    hold("SER_IMAGE_STM32F407");
}
