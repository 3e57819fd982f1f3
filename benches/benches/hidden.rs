//! The topic `HiddenLayer` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use elm_benches::topics::Topic;

fn hidden(criterion: &mut Criterion) {
    common::topic(criterion, Topic::HiddenLayer);
}

criterion_group!(benches, hidden);
criterion_main!(benches);
