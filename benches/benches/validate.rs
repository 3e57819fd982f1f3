//! The topic `Validate` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group};
use elm_benches::topics::Topic;

fn validate(criterion: &mut Criterion) {
    common::topic(criterion, Topic::Validate);
}

criterion_group!(benches, validate);
fn main() {
    elm_benches::timing::use_threads(1);
    benches();
    Criterion::default().configure_from_args().final_summary();
}
