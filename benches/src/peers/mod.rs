//! This project and what a user would pick instead, alternately on the same data.

mod compare;
mod data;
mod environment;
mod report;
mod rivals;
mod sweep;
mod worker;

pub use compare::{Plan, compare};
pub use data::{SIZES, Size};
pub use environment::{Environment, Trouble};
pub use report::{Format, Record, print};
pub use rivals::{Rival, fit_once};
pub use worker::Worker;
