//! A plugin for QEMU. It tells a bench which instructions the emulated processor executes, and
//! holds the processor where the bench wants.
//!
//! # Design
//! The bench listens on a local socket. The plugin is told the socket and the addresses to stop at,
//! and nothing else about the image. All decisions are the bench's.
//!
//! | option        | what                                         |
//! |---------------|----------------------------------------------|
//! | `socket=PATH` | where the bench listens                      |
//! | `stop=HEX`    | an address to stop at; as often as one likes |
//!
//! The plugin sends the bench addresses of instructions as 32-bit little-endian words: each
//! instruction executed, while the bench wants that, and each stop. The address of a Thumb
//! instruction is even, so an odd word is a stop. The processor then stands before the instruction
//! at the word less one, until the bench answers with a byte: `t` to be told of every instruction
//! from there on, anything else not to be.
//!
//! # Tradeoffs
//! A breakpoint of QEMU's debugger stub would stop the processor too. But it also stops the virtual
//! clock, and not at the same moment in each run. A plugin that takes its time is outside of time.
//!
//! # Notes
//! The interface is that of QEMU's `qemu-plugin.h`. What is used here has not changed since QEMU 5.
//! The version of the interface that a plugin has to name did change: 1 before QEMU 9, then 2.
//! `SER_QEMU_PLUGIN_API` chooses at build time.
#![cfg(target_os = "linux")]
#![expect(unsafe_code, reason = "QEMU's interface is one of C")]

mod link;
mod qemu;

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::sync::OnceLock;

use link::Link;

/// The interface that this plugin is for.
// SAFETY: nothing else has this name.
#[unsafe(no_mangle)]
pub static qemu_plugin_version: c_int = match option_env!("SER_QEMU_PLUGIN_API") {
    Some(version) if matches!(version.as_bytes(), b"2") => 2,
    _ => 1,
};

/// The bench. There is only one processor, so nobody ever waits for it.
static LINK: OnceLock<Link> = OnceLock::new();

/// QEMU calls this when it loads the plugin. Returns 0 if all is well.
///
/// # Safety
/// QEMU calls it once, with `argc` texts in `argv`.
// SAFETY: nothing else has this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn qemu_plugin_install(
    id: u64,
    _info: *const c_void,
    argc: c_int,
    argv: *const *const c_char,
) -> c_int {
    let texts = (0..usize::try_from(argc).unwrap_or(0)).map(|index| {
        // SAFETY: promised by QEMU.
        let text = unsafe { *argv.add(index) };
        // SAFETY: as above.
        unsafe { CStr::from_ptr(text) }.to_string_lossy()
    });
    match Link::open(texts) {
        Ok(link) => {
            let _ = LINK.set(link);
            // SAFETY: `id` is what QEMU gave, and the callback stays.
            unsafe { qemu::qemu_plugin_register_vcpu_tb_trans_cb(id, translated) };
            0
        }
        Err(what) => {
            eprintln!("image-bench-plugin: {what}");
            1
        }
    }
}

/// QEMU has translated a block of instructions, which may be executed any number of times.
extern "C" fn translated(_id: u64, block: *mut qemu::Block) {
    let Some(link) = LINK.get() else { return };
    // SAFETY: QEMU hands out a block that lives as long as this call.
    let count = unsafe { qemu::qemu_plugin_tb_n_insns(block) };
    for index in 0..count {
        // SAFETY: as above, and there are `count` instructions.
        let instruction = unsafe { qemu::qemu_plugin_tb_get_insn(block, index) };
        // SAFETY: as above.
        let address = unsafe { qemu::qemu_plugin_insn_vaddr(instruction) };
        let callback = if link.stops_at(address) { stopped } else { executed };
        let address = std::ptr::without_provenance_mut(usize::try_from(address).unwrap_or(0));
        // SAFETY: as above; the callback stays, and takes the address for the number that it is.
        unsafe {
            qemu::qemu_plugin_register_vcpu_insn_exec_cb(
                instruction,
                callback,
                qemu::NO_REGISTERS,
                address,
            );
        }
    }
}

/// An instruction is about to be executed.
extern "C" fn executed(_processor: c_uint, address: *mut c_void) {
    if let Some(link) = LINK.get() {
        link.executed(address.addr());
    }
}

/// An instruction that is a stop is about to be executed.
extern "C" fn stopped(_processor: c_uint, address: *mut c_void) {
    if let Some(link) = LINK.get() {
        link.stopped(address.addr());
    }
}
