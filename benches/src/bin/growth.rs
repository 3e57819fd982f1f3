//! How time grows with rows, inputs, neurons and outputs, against the order of the algorithm:
//! `cargo run --release -p elm-benches --bin growth`.
//!
//! The growth between two sizes is the power of their ratio that the ratio of times is. Small sizes
//! grow more slowly, by what does not depend on them.
#![allow(clippy::print_stdout)]

use elm::Error;
use elm_benches::timing::fastest_seconds;
use elm_benches::topics::ALL;

fn main() -> Result<(), Error> {
    elm_benches::timing::use_threads(1);
    println!("| topic | grows | from - to | order | growth, whole | growth, last step |");
    println!("|---|---|---|---|---|---|");
    for series in ALL {
        let mut times = Vec::new();
        for (value, shape) in series.shapes() {
            let mut work = series.topic.work(shape)?;
            work();
            times.push((value as f64, fastest_seconds(5, work)));
        }
        let power = |(a, s): (f64, f64), (b, t): (f64, f64)| (t / s).ln() / (b / a).ln();
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            continue;
        };
        let before = times[times.len() - 2];
        println!(
            "| {} | {} | {} - {} | {:.0} | {:.2} | {:.2} |",
            series.topic.name(),
            series.varied.name(),
            first.0,
            last.0,
            series.order,
            power(first, last),
            power(before, last)
        );
    }
    Ok(())
}
