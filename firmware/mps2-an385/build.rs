//! Puts the board's linker scripts where the linker looks for them.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    for script in ["memory.x", "device.x"] {
        println!("cargo::rerun-if-changed={script}");
        fs::copy(script, out.join(script)).expect("the linker scripts lie beside build.rs");
    }
    println!("cargo::rustc-link-search={}", out.display());
}
