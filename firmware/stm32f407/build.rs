//! Puts the board's linker script where the linker looks for it.

use std::path::PathBuf;
use std::{env, fs};

const SCRIPT: &str = "ram-image.x";

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    println!("cargo::rerun-if-changed={SCRIPT}");
    fs::copy(SCRIPT, out.join(SCRIPT)).expect("the linker script lies beside build.rs");
    println!("cargo::rustc-link-search={}", out.display());
    // Replaces cortex-m-rt's link.x. defmt's script places its strings in the ELF file, not in the
    // flash. They are named here and not in .cargo/config.toml, where RUSTFLAGS in the environment
    // would hide them.
    for script in [SCRIPT, "defmt.x"] {
        println!("cargo::rustc-link-arg-bins=-T{script}");
    }
}
