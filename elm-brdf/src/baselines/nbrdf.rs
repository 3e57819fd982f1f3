//! The published neural reflectance model NBRDF, from its weights.

use crate::fit::Model;
use elm_datasets::brdf::EvalError;
use ndarray::ArrayViewMut2;
use std::fs;
use std::path::Path;

use pulp::Simd;

use crate::batch::{Batched, Block, Columns, Dense, Kernel, ROWS, Real, eval_pairs, run};
use crate::error::{Error, Result};
use elm_datasets::Brdf;
use elm_datasets::geometry::DirectionPair;

/// Neurons of each of its two hidden layers.
const NEURONS: usize = 21;
/// Inputs, one of which is always 0.
const INPUTS: usize = 6;
const CHANNELS: usize = 3;

/// The trained network of one material of A. Sztrajman, G. Rainer, T. Ritschel and T. Weyrich,
/// *Neural BRDF Representation and Importance Sampling*, Computer Graphics Forum 40(6), 2021.
///
/// Two hidden layers of 21 rectified neurons each take the Cartesian components of the half vector
/// $h$ (turned to azimuth 0) and of the difference vector $d$, and give
/// $\ln(1 + f)$ of each channel $f$ in 1/sr. Not reciprocal. It cannot be fitted here; what others
/// have trained is [read](Self::read).
///
/// Evaluated by the layers that this project's own networks are
/// [evaluated by](crate::batch), in `f32`, and without an angle: with $s = \omega_i + \omega_o$ the
/// sines and cosines of $\theta_h$ and $\varphi_h$ are quotients of lengths, for a square root and
/// a division each.
#[derive(Debug, Clone)]
pub struct Nbrdf {
    /// From the five inputs that are not always 0.
    first: Dense<f32>,
    second: Dense<f32>,
    output: Dense<f32>,
}

impl Nbrdf {
    /// Numbers of a network.
    pub const FLOATS: usize =
        (INPUTS + 1) * NEURONS + (NEURONS + 1) * NEURONS + (NEURONS + 1) * CHANNELS;

    /// Puts a network together from its [`FLOATS`](Self::FLOATS) numbers: $W_1$ of shape (6, 21),
    /// $b_1$, $W_2$ (21, 21), $b_2$, $W_3$ (21, 3), $b_3$; matrices row by row, one for each input.
    /// The inputs are $\sin\theta_h$, 0, $\cos\theta_h$, $d_x$, $d_y$, $d_z$.
    ///
    /// # Errors
    /// [`Error::Shape`] for another count, [`Error::NotFinite`] naming the first number
    /// that is not finite.
    pub fn new(weights: &[f32]) -> Result<Self> {
        if weights.len() != Self::FLOATS {
            return Err(Error::Shape {
                what: "weights of NBRDF",
                expected: Self::FLOATS,
                found: weights.len(),
            });
        }
        if let Some(row) = weights.iter().position(|weight| !weight.is_finite()) {
            return Err(Error::NotFinite {
                what: "weights of NBRDF",
                row,
                column: 0,
            });
        }
        // Matrix and biases of a layer, and the rest.
        fn layer(numbers: &[f32], inputs: usize, outputs: usize) -> (&[f32], &[f32], &[f32]) {
            let (matrix, rest) = numbers.split_at(inputs * outputs);
            let (biases, rest) = rest.split_at(outputs);
            (matrix, biases, rest)
        }
        let dense = |(matrix, biases, _): (&[f32], &[f32], &[f32]), rows: &[usize]| {
            let outputs = biases.len();
            Dense::new(
                rows.len(),
                outputs,
                |input, output| f64::from(matrix[rows[input] * outputs + output]),
                |output| f64::from(biases[output]),
            )
        };
        let first = layer(weights, INPUTS, NEURONS);
        let second = layer(first.2, NEURONS, NEURONS);
        let output = layer(second.2, NEURONS, CHANNELS);
        let all: Vec<usize> = (0..NEURONS).collect();
        Ok(Self {
            first: dense(first, &[0, 2, 3, 4, 5]),
            second: dense(second, &all),
            output: dense(output, &all),
        })
    }

    /// Reads a file of [`FLOATS`](Self::FLOATS) little-endian `f32`, ordered as
    /// [`new`](Self::new) wants them.
    ///
    /// # Errors
    /// [`Error::Weights`] naming the file where it cannot be read, has another length, or holds a
    /// number that is not finite.
    pub fn read(path: &Path) -> Result<Self> {
        let failed = |reason: String| Error::Weights {
            path: path.to_owned(),
            reason,
        };
        let expected = Self::FLOATS * size_of::<f32>();
        let length = fs::metadata(path)
            .map_err(|error| failed(error.to_string()))?
            .len();
        // Looked at first: a file may be of any size.
        if length != expected as u64 {
            return Err(failed(format!(
                "{length} bytes, expected the {expected} of {} f32",
                Self::FLOATS
            )));
        }
        let bytes = fs::read(path).map_err(|error| failed(error.to_string()))?;
        let (words, _) = bytes.as_chunks();
        let weights: Vec<f32> = words.iter().copied().map(f32::from_le_bytes).collect();
        Self::new(&weights).map_err(|error| failed(error.to_string()))
    }

    /// BRDF in 1/sr, without the cosine: all reds, all greens, all blues.
    ///
    /// # Errors
    /// [`Error::Shape`] unless `out` has three values for each pair.
    pub fn eval_into(&self, directions: &Columns<f32>, out: &mut [f32]) -> Result<()> {
        run(self, CHANNELS, directions, out)
    }
}

/// $\sin\theta_h$, $\cos\theta_h$ and the components of $d = R_y(-\theta_h) R_z(-\varphi_h)
/// \omega_i$.
#[inline(always)]
fn inputs(d: &[&[f32; ROWS]; 6], x: &mut [Block<f32>; 5]) {
    let [sines, cosines, dx, dy, dz] = x;
    for r in 0..ROWS {
        let [ix, iy, iz, ox, oy, oz] = d.map(|part| part[r]);
        let (sx, sy, sz) = (ix + ox, iy + oy, iz + oz);
        let across_squared = sx * sx + sy * sy;
        let across = across_squared.sqrt();
        let length = (across_squared + sz * sz).sqrt();
        // Where there is no azimuth or no half vector, any does.
        let per_across = 1.0 / across.max(f32::MIN_POSITIVE);
        let per_length = 1.0 / length.max(f32::MIN_POSITIVE);
        let (sine, cosine) = (across * per_length, sz * per_length);
        let (cos_phi, sin_phi) = if across > 0.0 {
            (sx * per_across, sy * per_across)
        } else {
            (1.0, 0.0)
        };
        let turned = cos_phi * ix + sin_phi * iy;
        sines.0[r] = sine;
        cosines.0[r] = cosine;
        dx.0[r] = cosine * turned - sine * iz;
        dy.0[r] = cos_phi * iy - sin_phi * ix;
        dz.0[r] = sine * turned + cosine * iz;
    }
}

impl Kernel<f32> for Nbrdf {
    fn scratch(&self) -> usize {
        // Inputs and first layer; then the second; then the outputs over the inputs.
        5 + 2 * NEURONS
    }

    #[inline(always)]
    fn block<S: Simd>(
        &self,
        simd: S,
        directions: &[&[f32; ROWS]; 6],
        scratch: &mut [Block<f32>],
        out: &mut [Block<f32>],
    ) {
        let Some((x, rest)) = scratch.split_first_chunk_mut::<5>() else {
            return;
        };
        let (one, two) = rest.split_at_mut(NEURONS);
        inputs(directions, x);
        self.first.run::<S, true>(simd, x, one);
        self.second.run::<S, true>(simd, one, two);
        self.output.run::<S, false>(simd, two, &mut x[..CHANNELS]);
        let (iz, oz) = (directions[2], directions[5]);
        for (x, out) in x.iter().zip(out) {
            let directions = iz.iter().zip(oz);
            for ((out, x), (&iz, &oz)) in out.0.iter_mut().zip(&x.0).zip(directions) {
                let value = f32::exponential(*x) - 1.0;
                let above = iz > 0.0 && oz > 0.0;
                *out = if above { value.max(0.0) } else { 0.0 };
            }
        }
    }
}

impl Batched<f32> for Nbrdf {
    fn channels(&self) -> usize {
        CHANNELS
    }

    fn eval_into(&self, directions: &Columns<f32>, out: &mut [f32]) -> Result<()> {
        Nbrdf::eval_into(self, directions, out)
    }
}

impl Brdf for Nbrdf {
    fn channels(&self) -> usize {
        CHANNELS
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        eval_pairs(self, pairs, values)
    }
}

impl Model for Nbrdf {
    fn multiply_adds(&self) -> usize {
        (INPUTS + NEURONS + CHANNELS) * NEURONS
    }

    fn floats_per_channel(&self) -> usize {
        // The channels share the hidden layers.
        Self::FLOATS - (CHANNELS - 1) * (NEURONS + 1)
    }

    fn stored_floats(&self) -> usize {
        Self::FLOATS
    }
}
