//! The topic `Validate` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use elm_benches::topics::Topic;

fn validate(criterion: &mut Criterion) {
    common::topic(criterion, Topic::Validate);
}

criterion_group!(benches, validate);
criterion_main!(benches);
