//! The library and the program as their users see them. One program, as the code under test would be linked
//! anew for each.

// Helpers of tests are not seen as tests; figures are for whoever runs a test by hand.
#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr)]

mod anisotropy;
mod browser;
mod compare;
mod errors;
mod export;
mod exports;
#[cfg(feature = "fetch")]
mod fetch;
mod files;
mod fit;
mod gallery;
mod guides;
mod help;
mod measured;
mod mitsuba;
mod model;
mod nbrdf;
mod networks;
mod pareto;
mod pictures;
mod precision;
mod predict;
mod prior;
mod render;
mod renderers;
mod reproduce;
mod rgl_spheres;
mod samplers;
mod sampling;
mod spectra;
mod support;
mod tuned;
