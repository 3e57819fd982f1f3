//! Activation functions over a hidden-layer matrix that fits the first-level cache, through the
//! only place that shows them alone: a network of one input.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group};
use elm::{Accuracy, Activation, Scalar};
use elm_benches::networks::{network, rows};
use ndarray::Array2;

const ROWS: usize = 256;
const NEURONS: usize = 256;

fn activation(criterion: &mut Criterion) {
    each::<f64>(criterion);
    each::<f32>(criterion);
}

fn each<A: Scalar>(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group(format!("activation {}", A::NAME));
    group.throughput(Throughput::Elements((ROWS * NEURONS) as u64));
    let x = rows(ROWS, 1);
    for function in Activation::<A>::BUILT_IN {
        for accuracy in [Accuracy::Full, Accuracy::Fast] {
            let Ok(model) = network(1, NEURONS, 1, function.clone()) else {
                return;
            };
            let predictor = model.predictor().with_accuracy(accuracy);
            let mut scratch = predictor.scratch();
            let mut out = Array2::zeros((ROWS, 1));
            let id = BenchmarkId::new(function.name(), format!("{accuracy:?}"));
            group.bench_function(id, |bencher| {
                bencher.iter(|| predictor.predict_into(black_box(&x), &mut out, &mut scratch));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, activation);
fn main() {
    elm_benches::timing::use_threads(1);
    benches();
    Criterion::default().configure_from_args().final_summary();
}
