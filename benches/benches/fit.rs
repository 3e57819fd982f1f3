//! The topic `Fit` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use elm_benches::topics::Topic;

fn fit(criterion: &mut Criterion) {
    common::topic(criterion, Topic::Fit);
}

criterion_group!(benches, fit);
criterion_main!(benches);
