//! Reference models
mod analytic;
mod gaussian_process;
mod inputs;
mod kernel;
mod koenderink;
mod neighbours;
mod radial;
pub use analytic::*;
pub use gaussian_process::*;
pub use koenderink::*;
pub use neighbours::*;
pub use radial::*;
