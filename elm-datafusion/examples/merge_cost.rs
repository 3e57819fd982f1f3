//! Prints the bytes of an accumulator's state and the seconds that a merge of two takes, for some numbers of
//! neurons: `merge_cost 60 500 2000`.

use std::error::Error;
use std::time::Instant;

use elm::solve::Ridge;
use elm::{Accumulator, ElmParams, persist};
use ndarray::{Array2, Axis};

fn main() -> Result<(), Box<dyn Error>> {
    for neurons in std::env::args().skip(1) {
        let neurons: usize = neurons.parse()?;
        let rows = neurons * 4 + 100;
        let x = Array2::from_shape_fn((rows, 20), |(i, j)| ((i * (j + 3)) as f64 * 0.37).sin());
        let y = x.sum_axis(Axis(1)).mapv(f64::sin).insert_axis(Axis(1));
        let params = ElmParams::new(neurons).with_solver(Ridge::gcv());
        let mut one: Accumulator<f64> = Accumulator::from_sample(&params, &x, 1)?;
        one.push(&x, &y)?;
        one.compact()?;
        let mut other: Accumulator<f64> = persist::from_bytes(&persist::to_bytes(&one)?)?;
        let start = Instant::now();
        other.merge(&one)?;
        let merge = start.elapsed().as_secs_f64();
        let start = Instant::now();
        other.fit()?;
        let fit = start.elapsed().as_secs_f64();
        let bytes = persist::to_bytes(&one)?.len();
        println!("{neurons} neurons: {bytes} bytes, merge {merge:.4} s, fit {fit:.4} s");
    }
    Ok(())
}
