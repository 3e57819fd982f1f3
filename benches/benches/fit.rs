//! The topic `Fit` over sizes; elements are rows.

mod common;

use criterion::{Criterion, criterion_group};
use elm_benches::topics::Topic;

fn fit(criterion: &mut Criterion) {
    common::topic(criterion, Topic::Fit);
}

criterion_group!(benches, fit);
fn main() {
    elm_benches::timing::use_threads(1);
    benches();
    Criterion::default().configure_from_args().final_summary();
}
