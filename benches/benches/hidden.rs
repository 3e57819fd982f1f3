//! The topic `HiddenLayer` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group};
use elm_benches::topics::Topic;

fn hidden(criterion: &mut Criterion) {
    common::topic(criterion, Topic::HiddenLayer);
}

criterion_group!(benches, hidden);
fn main() {
    elm_benches::timing::use_threads(1);
    benches();
    Criterion::default().configure_from_args().final_summary();
}
