//! Where the stack is used: the deepest paths through an image.

use std::fmt::Write as _;

use ser_console::Harmless;

use crate::calls::Calls;
use crate::checks::{shares, together};
use crate::image::Image;
use crate::limits::Limits;
use crate::walk::Callee;

/// The deepest path of the main program and of each handler, the deepest handler first.
pub(crate) fn shown(limits: &Limits, image: &Image, calls: &Calls<'_>) -> String {
    let mut text = format!("\n{}, the stack at its deepest, in bytes:\n", limits.board);
    let Ok(mut shares) = shares(image, calls) else { return text + "  no bound\n" };
    shares.sort_by_key(|share| (share.saved > 0, std::cmp::Reverse(share.deepest.bytes)));
    let mut saved = 0;
    for share in &shares {
        let names: Vec<_> =
            share.deepest.path.iter().map(|&function| harmless(image, function)).collect();
        let own = if share.deepest.other_stack.is_some() { ", on a stack of its own" } else { "" };
        _ = writeln!(text, "{:7}  {}{own}", share.deepest.bytes, names.join(" → "));
        saved += share.saved;
    }
    _ = writeln!(
        text,
        "{saved:7}  registers that the processor saves for {} handlers",
        shares.len().saturating_sub(1)
    );
    _ = writeln!(text, "{:7}  together", together(&shares));
    text + &computed(image, calls)
}

/// The calls whose target only the running program knows.
fn computed(image: &Image, calls: &Calls<'_>) -> String {
    let computed = calls
        .walks()
        .flat_map(|(_, walk)| &walk.calls)
        .filter(|call| call.callee == Callee::Computed);
    computed.fold(String::new(), |text, call| {
        let targets: Vec<_> =
            calls.targets(call).map(|function| harmless(image, function)).collect();
        format!("{text}  {} calls one of: {}\n", harmless(image, call.at), targets.join(", "))
    })
}

/// The name of a function, filtered because it may be anything.
fn harmless(image: &Image, address: u32) -> String {
    Harmless(image.name_of(address)).line()
}
