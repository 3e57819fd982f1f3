//! Says whether rustc shares instances of generic functions with crates above: up to optimization level 1, as
//! in development (decision 23).

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(shares_generics)");
    let level = std::env::var("OPT_LEVEL").unwrap_or_default();
    if matches!(level.as_str(), "0" | "1" | "s" | "z") {
        println!("cargo::rustc-cfg=shares_generics");
    }
}
