//! The machine's limits on one thread, and the share of them that evaluation reaches:
//! `cargo run --release -p elm-benches --bin limits`.
#![allow(clippy::print_stdout)]

use elm::{Activation, Error, Scalar};
use elm_benches::networks::{network, rows};
use elm_benches::peaks;
use elm_benches::timing::fastest_seconds;
use ndarray::Array2;

/// Vector instructions of one tanh on registers, by the formula: 12 additions, multiplications
/// and multiply-adds, one for each coefficient of the series (5 in `f64`, 2 in `f32`), and a
/// division.
/// Moving bits (sign, comparison, exponent) and memory are not counted.
const fn tanh_operations(coefficients: usize) -> usize {
    12 + coefficients + 1
}

const INPUTS: usize = 10;
const NEURONS: usize = 500;
const ROWS: usize = 4096;

fn main() -> Result<(), Error> {
    elm_benches::timing::use_threads(1);
    println!("multiply-adds per second, one thread (a lane's multiply-add is one):");
    let mut peaks_found = (0.0_f64, 0.0_f64);
    for (name, arch) in peaks::levels() {
        let (double, single) = (peaks::multiply_add_f64(arch), peaks::multiply_add_f32(arch));
        peaks_found = (peaks_found.0.max(double), peaks_found.1.max(single));
        println!(
            "  {name:<12} f64 {:7.1}e9   f32 {:7.1}e9",
            double / 1e9,
            single / 1e9
        );
    }
    let product = peaks::matrix_product(512);
    println!(
        "  faer's product of 512 x 512 in f64 {:.1}e9: {:.0} % of the peak",
        product / 1e9,
        100.0 * product / peaks_found.0
    );
    println!("reading, bytes per second:");
    for (name, bytes) in [
        ("16 KiB", 1 << 14),
        ("512 KiB", 1 << 19),
        ("256 MiB", 1 << 28),
    ] {
        println!("  {name:<8} {:.1}e9", peaks::read_bandwidth(bytes) / 1e9);
    }
    println!("evaluation, {INPUTS} inputs, {NEURONS} tanh neurons, 1 output, {ROWS} rows:");
    evaluation::<f64>(peaks_found.0, tanh_operations(5))?;
    evaluation::<f32>(peaks_found.1, tanh_operations(2))
}

fn evaluation<A: Scalar>(peak: f64, tanh: usize) -> Result<(), Error> {
    let predictor = network::<A>(INPUTS, NEURONS, 1, Activation::Tanh)?.predictor();
    let x = rows(ROWS, INPUTS);
    let mut out = Array2::zeros((ROWS, 1));
    let mut scratch = predictor.scratch();
    predictor.predict_into(&x, &mut out, &mut scratch)?;
    let seconds = fastest_seconds(30, || {
        // Checked above: the same call cannot fail.
        let _ = predictor.predict_into(&x, &mut out, &mut scratch);
    });
    let operations = ROWS * NEURONS * (INPUTS + tanh + 1);
    let rate = operations as f64 / seconds;
    println!(
        "  {} {:.3} ns per neuron and row, {} operations each: {:.1}e9 per second, {:.0} % of the peak",
        A::NAME,
        1e9 * seconds / (ROWS * NEURONS) as f64,
        INPUTS + tanh + 1,
        rate / 1e9,
        100.0 * rate / peak
    );
    Ok(())
}
