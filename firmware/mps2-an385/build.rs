//! Puts the board's linker scripts where the linker looks for them, and names those of the
//! libraries.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    for script in ["memory.x", "device.x"] {
        println!("cargo::rerun-if-changed={script}");
        fs::copy(script, out.join(script)).expect("the linker scripts lie beside build.rs");
    }
    println!("cargo::rustc-link-search={}", out.display());
    // cortex-m-rt's memory layout, which includes memory.x and device.x, and defmt's place for its
    // strings, in the ELF file and not in the flash. They are named here and not in
    // .cargo/config.toml, where RUSTFLAGS in the environment would hide them.
    for script in ["link.x", "defmt.x"] {
        println!("cargo::rustc-link-arg-bins=-T{script}");
    }
}
