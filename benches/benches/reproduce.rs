//! The paper's protocol on the 61 materials of the synthetic data, with one factorisation per fold for
//! all materials together against one per fold and material, and against one in all.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group};
use elm_brdf::fit::Fit;
use elm_brdf::model::{BrdfModel, BrdfParams, GlobalScaling};
use elm_brdf::protocol::{Folds, cross_validate};
use elm_datasets::{Invalid, MaterialId, Measurements, synthetic};
use ndarray::{Axis, concatenate};

fn scores(data: &Measurements, folds: &Folds) -> usize {
    cross_validate(&BrdfParams::paper(50), data, folds, |_, _| {}).map_or(0, |scores| scores.len())
}

fn reproduce(criterion: &mut Criterion) {
    let all: Vec<MaterialId> = MaterialId::all().collect();
    let together = synthetic::measurements(1, &all, Invalid::Clamp);
    let apart: Vec<Measurements> = all
        .iter()
        .map(|&id| synthetic::measurements(1, &[id], Invalid::Clamp))
        .collect();
    let Ok(folds) = Folds::new(together.directions.len(), 10, 1) else {
        return;
    };

    let mut group = criterion.benchmark_group("reproduce");
    group.throughput(Throughput::Elements(all.len() as u64));
    group.bench_function("all materials together", |bencher| {
        bencher.iter(|| scores(black_box(&together), &folds));
    });
    group.bench_function("all materials together, inputs scaled once", |bencher| {
        let Ok(once) = GlobalScaling::new(BrdfParams::paper(50)) else {
            return;
        };
        bencher.iter(|| {
            let scores = cross_validate(&once, black_box(&together), &folds, |_, _| {});
            scores.map_or(0, |scores| scores.len())
        });
    });
    // The fits alone: every metric costs the same whichever way they were had.
    let values: Vec<_> = together.materials.iter().map(|m| m.values.view()).collect();
    let Ok(values) = concatenate(Axis(1), &values) else {
        return;
    };
    let pairs = &together.directions;
    let labels: Vec<usize> = (0..pairs.len()).map(|row| folds.of_row(row)).collect();
    for (name, once) in [
        ("fits, fold by fold", false),
        ("fits, inputs scaled once", true),
    ] {
        let Ok(scaled) = GlobalScaling::new(BrdfParams::paper(50)) else {
            return;
        };
        let plain = BrdfParams::paper(50);
        let method: &dyn Fit<Model = BrdfModel> = if once { &scaled } else { &plain };
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let fits = method.cross_fits(pairs, values.view(), &labels, 10, &|_| {});
                fits.map_or(0, |fits| fits.len())
            });
        });
    }
    group.bench_function("each material by itself", |bencher| {
        bencher.iter(|| {
            apart
                .iter()
                .map(|one| scores(black_box(one), &folds))
                .sum::<usize>()
        });
    });
    group.finish();
}

criterion_group!(benches, reproduce);
fn main() {
    elm_benches::timing::use_threads(1);
    benches();
    Criterion::default().configure_from_args().final_summary();
}
