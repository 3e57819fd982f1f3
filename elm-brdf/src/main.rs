//! The `elm-brdf` program; see [`elm_brdf::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    elm_brdf::cli::run()
}
