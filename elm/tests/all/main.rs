//! What the library promises, through its public interface. One program, as the solvers would be
//! compiled anew for each.

// Helpers of tests are not seen as tests.
#![allow(clippy::unwrap_used, clippy::panic)]

mod accumulate;
mod accumulate_deficient;
mod accumulate_states;
mod bad_input;
mod bounds;
mod classify;
mod common;
mod csv_example;
mod dataset;
mod exchangeable;
mod hostile;
mod importance;
mod many_rows;
mod persist;
mod prune;
mod ramps;
mod settings;
mod solve;
mod threads;
mod tune;
mod uncertainty;
mod unlike_inputs;
mod validate;
mod weights;
