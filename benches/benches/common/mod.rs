//! A topic's series as criterion benches.

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput};
use elm_benches::topics::{ALL, Topic};

/// Every series of `topic`, with throughput in rows.
pub(crate) fn topic(criterion: &mut Criterion, topic: Topic) {
    for series in ALL.iter().filter(|series| series.topic == topic) {
        let name = format!("{}, by {}", topic.name(), series.varied.name());
        let mut group = criterion.benchmark_group(name);
        group
            .sample_size(10)
            .warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_secs(2));
        for (value, shape) in series.shapes() {
            let Ok(mut work) = topic.work(shape) else {
                continue;
            };
            group.throughput(Throughput::Elements(shape.rows as u64));
            let rest = format!(
                "{} rows, {} inputs, {} neurons, {} outputs",
                shape.rows, shape.inputs, shape.neurons, shape.outputs
            );
            group.bench_function(BenchmarkId::new(rest, value), |bencher| {
                bencher.iter(&mut work);
            });
        }
        group.finish();
    }
}
