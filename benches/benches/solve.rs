//! The topic `Solve` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use elm_benches::topics::Topic;

fn solve(criterion: &mut Criterion) {
    common::topic(criterion, Topic::Solve);
}

criterion_group!(benches, solve);
criterion_main!(benches);
