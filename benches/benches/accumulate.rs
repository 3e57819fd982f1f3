//! The topic `Accumulate` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use elm_benches::topics::Topic;

fn accumulate(criterion: &mut Criterion) {
    common::topic(criterion, Topic::Accumulate);
}

criterion_group!(benches, accumulate);
criterion_main!(benches);
