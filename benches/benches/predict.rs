//! Evaluation against rows, neurons, inputs and outputs; elements are neurons times rows.

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group};
use elm::{Activation, Scalar};
use elm_benches::networks::{network, rows};
use ndarray::Array2;

fn predict(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("predict rows, 10 inputs, 200 neurons, 1 output");
    for rows in [1, 16, 100, 1000, 10_000, 100_000, 1_000_000] {
        group.sample_size(if rows > 10_000 { 10 } else { 50 });
        size::<f64>(&mut group, "f64", rows, 10, 200, 1);
        size::<f32>(&mut group, "f32", rows, 10, 200, 1);
    }
    group.finish();

    let mut group = criterion.benchmark_group("predict neurons, 1000 rows, 10 inputs, 1 output");
    for neurons in [16, 60, 200, 500, 1000, 2000] {
        size::<f64>(&mut group, "f64", 1000, 10, neurons, 1);
        size::<f32>(&mut group, "f32", 1000, 10, neurons, 1);
    }
    group.finish();

    let mut group = criterion.benchmark_group("predict inputs, 1000 rows, 200 neurons, 1 output");
    for inputs in [1, 6, 20, 100] {
        size::<f64>(&mut group, "f64", 1000, inputs, 200, 1);
    }
    group.finish();

    let mut group = criterion.benchmark_group("predict outputs, 1000 rows, 6 inputs, 200 neurons");
    for outputs in [1, 3, 16, 61, 183] {
        size::<f64>(&mut group, "f64", 1000, 6, 200, outputs);
    }
    group.finish();
}

fn size<A: Scalar>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    row_count: usize,
    inputs: usize,
    neurons: usize,
    outputs: usize,
) {
    let Ok(model) = network::<A>(inputs, neurons, outputs, Activation::Tanh) else {
        return;
    };
    let predictor = model.predictor();
    let mut scratch = predictor.scratch();
    let x = rows(row_count, inputs);
    let mut out = Array2::zeros((row_count, outputs));
    group.throughput(Throughput::Elements((row_count * neurons) as u64));
    let parameter = format!("{row_count} x {inputs} -> {neurons} -> {outputs}");
    group.bench_function(BenchmarkId::new(name, parameter), |bencher| {
        bencher.iter(|| predictor.predict_into(black_box(&x), &mut out, &mut scratch));
    });
}

criterion_group!(benches, predict);
fn main() {
    elm_benches::timing::use_threads(1);
    benches();
    Criterion::default().configure_from_args().final_summary();
}
