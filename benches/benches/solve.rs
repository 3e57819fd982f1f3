//! The topic `Solve` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group};
use elm_benches::topics::Topic;

fn solve(criterion: &mut Criterion) {
    common::topic(criterion, Topic::Solve);
}

criterion_group!(benches, solve);
fn main() {
    elm_benches::timing::use_threads(1);
    benches();
    Criterion::default().configure_from_args().final_summary();
}
