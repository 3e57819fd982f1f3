//! The regression problems of the comparison.

use std::f64::consts::PI;
use std::fs;
use std::io;
use std::path::Path;
use std::str::FromStr;

use elm::advanced::HiddenLayer;
use ndarray::{Array2, ArrayView1, Axis};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};

/// A problem's size and the network that is fitted to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Its name on the command line and in the results.
    pub name: &'static str,
    /// Training rows.
    pub rows: usize,
    /// Inputs.
    pub inputs: usize,
    /// Hidden neurons.
    pub neurons: usize,
    /// Outputs.
    pub outputs: usize,
}

/// The sizes that are compared, smallest first.
pub const SIZES: [Size; 4] = [
    size("185x6-60x3", 185, 6, 60, 3),
    size("2000x10-200", 2000, 10, 200, 1),
    size("20000x20-500", 20_000, 20, 500, 1),
    size("100000x20-1000", 100_000, 20, 1000, 1),
];

const fn size(
    name: &'static str,
    rows: usize,
    inputs: usize,
    neurons: usize,
    outputs: usize,
) -> Size {
    Size {
        name,
        rows,
        inputs,
        neurons,
        outputs,
    }
}

impl FromStr for Size {
    type Err = String;

    /// By name, or by the number of rows alone.
    fn from_str(text: &str) -> Result<Self, String> {
        let rows = |size: &&Size| size.rows.to_string() == text;
        SIZES
            .iter()
            .find(|size| size.name == text || rows(size))
            .copied()
            .ok_or_else(|| {
                let names = SIZES.map(|size| size.name).join(", ");
                format!("no size '{text}'; there are {names}")
            })
    }
}

/// Training rows with noise, test rows without.
pub(super) struct Problem {
    pub(super) x: Array2<f64>,
    pub(super) t: Array2<f64>,
    pub(super) test_x: Array2<f64>,
    pub(super) test_t: Array2<f64>,
}

/// Standard deviation of the noise; the function's own is 4.9.
const NOISE: f64 = 0.5;
/// Rows that errors are measured on.
const TEST_ROWS: usize = 2000;

impl Problem {
    /// Friedman's first function (Annals of Statistics 19, 1991) of inputs even over 0 to 1; each
    /// further output begins one input later. Inputs beyond the fifth do not matter to the first.
    pub(super) fn new(size: Size) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(size.rows as u64);
        let mut inputs = |rows: usize| -> Array2<f64> {
            Array2::from_shape_simple_fn((rows, size.inputs), || {
                StandardUniform.sample(&mut random)
            })
        };
        let (x, test_x) = (inputs(size.rows), inputs(TEST_ROWS));
        let targets = |x: &Array2<f64>| {
            Array2::from_shape_fn((x.nrows(), size.outputs), |(row, output)| {
                friedman(x.row(row), output)
            })
        };
        let mut noise = random.clone();
        noise.set_stream(1);
        let mut t = targets(&x);
        t.mapv_inplace(|t| {
            let deviation: f64 = StandardNormal.sample(&mut noise);
            t + NOISE * deviation
        });
        Self {
            test_t: targets(&test_x),
            x,
            t,
            test_x,
        }
    }

    /// Writes the four matrices and our network's layer as little-endian `f64` by rows.
    pub(super) fn write(&self, folder: &Path, layer: &HiddenLayer<f64>) -> io::Result<()> {
        for (name, values) in [
            ("x", self.x.view()),
            ("t", self.t.view()),
            ("test_x", self.test_x.view()),
            ("test_t", self.test_t.view()),
            ("weights", layer.weights()),
            ("biases", layer.biases().insert_axis(Axis(0))),
        ] {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            fs::write(folder.join(name), bytes)?;
        }
        Ok(())
    }
}

fn friedman(x: ArrayView1<'_, f64>, first: usize) -> f64 {
    let x = |i: usize| x[(first + i) % x.len()];
    10.0 * (PI * x(0) * x(1)).sin() + 20.0 * (x(2) - 0.5).powi(2) + 10.0 * x(3) + 5.0 * x(4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_found_by_name_or_rows() {
        assert_eq!("2000".parse::<Size>(), Ok(SIZES[1]));
        assert_eq!("185x6-60x3".parse::<Size>(), Ok(SIZES[0]));
        assert!("18".parse::<Size>().is_err());
    }

    #[test]
    fn the_first_output_is_friedmans_function_and_the_others_its_shifts() {
        let x = ndarray::array![0.5, 1.0, 0.0, 0.2, 0.4, 0.9];
        let expected = 10.0 + 5.0 + 2.0 + 2.0;
        assert!((friedman(x.view(), 0) - expected).abs() < 1e-12);
        let turned = ndarray::array![1.0, 0.0, 0.2, 0.4, 0.9, 0.5];
        assert_eq!(friedman(x.view(), 1), friedman(turned.view(), 0));
    }
}
