//! The two products of evaluation over packed weights, on vector registers.
//!
//! Lanes are neurons. Each sum is taken in one order that depends neither on the vector unit's
//! width nor on how many rows are evaluated together, so a row's prediction is the same bits
//! alone, in a batch, and on every processor with fused multiply-add.

use pulp::{Simd, WithSimd};

use super::packed::Packed;
use crate::scalar::Scalar;
use crate::simd::Lanes;

/// Rows whose weighted sums are taken together, one register each.
pub(crate) const ROWS: usize = 8;

/// Panels whose weighted sums are taken together for a row by itself.
const PANELS: usize = 4;

/// Splits a count of rows into blocks of [`ROWS`] and single ones: (first row, rows).
pub(crate) fn row_blocks(rows: usize) -> impl Iterator<Item = (usize, usize)> {
    let whole = rows / ROWS * ROWS;
    (0..whole)
        .step_by(ROWS)
        .map(|first| (first, ROWS))
        .chain((whole..rows).map(|first| (first, 1)))
}

/// Weighted sums $x \cdot \omega_k + b_k$ of a range of panels for a tile of rows; or, of radial
/// neurons, the distances $\lVert x - \omega_k \rVert$.
pub(crate) struct Project<'a, A: Scalar> {
    pub(crate) packed: &'a Packed<A>,
    pub(crate) first_panel: usize,
    pub(crate) panels: usize,
    pub(crate) rows: usize,
    pub(crate) radial: bool,
    /// Inputs by [`row_blocks`], and in a block input by input.
    pub(crate) inputs: &'a [A],
    /// Receives `rows` rows of `panels` lines.
    pub(crate) hidden: &'a mut [A],
}

impl<A: Scalar> WithSimd for Project<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if self.radial {
            self.project::<S, true>(simd);
        } else {
            self.project::<S, false>(simd);
        }
    }
}

impl<A: Scalar> Project<'_, A> {
    #[inline(always)]
    fn project<S: Simd, const RADIAL: bool>(self, simd: S) {
        let (inputs, panels) = (self.packed.inputs, self.panels);
        let weights = self.packed.hidden(self.first_panel, panels);
        let per_line = A::registers::<S>(&weights[..A::LINE]).0.len();
        let weights = A::registers::<S>(weights).0;
        let hidden = A::registers_mut::<S>(self.hidden).0;
        let (per_panel, per_row) = ((inputs + 1) * per_line, panels * per_line);
        let whole = self.rows / ROWS * ROWS;
        for (panel, weights) in weights.chunks_exact(per_panel).enumerate() {
            for first in (0..whole).step_by(ROWS) {
                let x = &self.inputs[first * inputs..][..ROWS * inputs];
                for lane in 0..per_line {
                    let to = &mut hidden[first * per_row + panel * per_line + lane..];
                    let weights = &weights[lane..];
                    project::<S, A, RADIAL, ROWS, 1>(simd, weights, per_line, 0, x, to, per_row, 0);
                }
            }
        }
        // A single row has no neighbours to hide latency with; it takes panels together instead.
        for row in whole..self.rows {
            let x = &self.inputs[row * inputs..][..inputs];
            let hidden = &mut hidden[row * per_row..][..per_row];
            let mut panel = 0;
            while panel < panels {
                let together = if panel + PANELS <= panels { PANELS } else { 1 };
                for lane in 0..per_line {
                    let to = &mut hidden[panel * per_line + lane..];
                    let weights = &weights[panel * per_panel + lane..];
                    if together == PANELS {
                        project::<S, A, RADIAL, 1, PANELS>(
                            simd, weights, per_line, per_panel, x, to, 0, per_line,
                        );
                    } else {
                        project::<S, A, RADIAL, 1, 1>(simd, weights, per_line, 0, x, to, 0, 0);
                    }
                }
                panel += together;
            }
        }
    }
}

/// One register of neurons in each of `P` panels for `R` rows. In `weights` inputs are `per_line`
/// apart and panels `per_panel`; in `to`, rows `row_stride` and panels `panel_stride`.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn project<S: Simd, A: Scalar, const RADIAL: bool, const R: usize, const P: usize>(
    simd: S,
    weights: &[A::Register<S>],
    per_line: usize,
    per_panel: usize,
    x: &[A],
    to: &mut [A::Register<S>],
    row_stride: usize,
    panel_stride: usize,
) {
    let mut sums = [[Lanes::<S, A>::splat(simd, A::ZERO); P]; R];
    for sums in &mut sums {
        for (panel, sum) in sums.iter_mut().enumerate() {
            *sum = Lanes::new(simd, weights[panel * per_panel]);
        }
    }
    for (input, x) in x.as_chunks::<R>().0.iter().enumerate() {
        let mut line = [Lanes::<S, A>::splat(simd, A::ZERO); P];
        for (panel, weight) in line.iter_mut().enumerate() {
            *weight = Lanes::new(simd, weights[(input + 1) * per_line + panel * per_panel]);
        }
        for (sums, &x) in sums.iter_mut().zip(x) {
            let x = Lanes::splat(simd, x);
            for (sum, &weight) in sums.iter_mut().zip(&line) {
                *sum = if RADIAL {
                    let apart = x - weight;
                    apart.mul_add(apart, *sum)
                } else {
                    weight.mul_add(x, *sum)
                };
            }
        }
    }
    for (row, sums) in sums.iter().enumerate() {
        for (panel, sum) in sums.iter().enumerate() {
            let z = if RADIAL { sum.sqrt() } else { *sum };
            to[row * row_stride + panel * panel_stride] = z.register();
        }
    }
}

/// Adds the contribution of a range of panels to every output: $\beta^T h$, still in lanes.
pub(crate) struct Accumulate<'a, A: Scalar> {
    pub(crate) packed: &'a Packed<A>,
    pub(crate) first_panel: usize,
    pub(crate) panels: usize,
    /// Rows of `panels` lines.
    pub(crate) hidden: &'a [A],
    /// Per row a line for each output.
    pub(crate) sums: &'a mut [A],
}

impl<A: Scalar> WithSimd for Accumulate<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (panels, outputs) = (self.panels, self.packed.outputs);
        let row_length = panels * A::LINE;
        let sums_length = outputs * A::LINE;
        let beta = |output| self.packed.beta(output, self.first_panel, panels);
        // Three outputs at once, so that a hidden value is loaded once for all of them.
        let triples = outputs / 3 * 3;
        for output in (0..triples).step_by(3) {
            let beta = [beta(output), beta(output + 1), beta(output + 2)];
            let mut hidden = self.hidden.chunks_exact(4 * row_length);
            let mut sums = self.sums.chunks_exact_mut(4 * sums_length);
            for (hidden, sums) in hidden.by_ref().zip(sums.by_ref()) {
                accumulate::<S, A, 4, 3>(simd, beta, hidden, sums, output);
            }
            let hidden = hidden.remainder().chunks_exact(row_length);
            let sums = sums.into_remainder().chunks_exact_mut(sums_length);
            for (hidden, sums) in hidden.zip(sums) {
                accumulate::<S, A, 1, 3>(simd, beta, hidden, sums, output);
            }
        }
        for output in triples..outputs {
            let beta = [beta(output)];
            let mut hidden = self.hidden.chunks_exact(8 * row_length);
            let mut sums = self.sums.chunks_exact_mut(8 * sums_length);
            for (hidden, sums) in hidden.by_ref().zip(sums.by_ref()) {
                accumulate::<S, A, 8, 1>(simd, beta, hidden, sums, output);
            }
            let hidden = hidden.remainder().chunks_exact(row_length);
            let sums = sums.into_remainder().chunks_exact_mut(sums_length);
            for (hidden, sums) in hidden.zip(sums) {
                accumulate::<S, A, 1, 1>(simd, beta, hidden, sums, output);
            }
        }
    }
}

/// `R` rows and `O` outputs from `first` on.
#[inline(always)]
fn accumulate<S: Simd, A: Scalar, const R: usize, const O: usize>(
    simd: S,
    beta: [&[A]; O],
    hidden: &[A],
    sums: &mut [A],
    first: usize,
) {
    let length = beta[0].len();
    let beta: [&[A::Register<S>]; O] =
        std::array::from_fn(|o| A::registers::<S>(&beta[o][..length]).0);
    let rows: [&[A::Register<S>]; R] =
        std::array::from_fn(|r| A::registers::<S>(&hidden[r * length..(r + 1) * length]).0);
    let sums = A::registers_mut::<S>(sums).0;
    let per_line = A::LINE / (length / beta[0].len());
    let per_row = sums.len() / R;
    for lane in 0..per_line {
        let mut partial = [[Lanes::<S, A>::splat(simd, A::ZERO); O]; R];
        for index in (lane..beta[0].len()).step_by(per_line) {
            let mut weights = [Lanes::<S, A>::splat(simd, A::ZERO); O];
            for (weight, beta) in weights.iter_mut().zip(&beta) {
                *weight = Lanes::new(simd, beta[index]);
            }
            for (partial, row) in partial.iter_mut().zip(&rows) {
                let value = Lanes::new(simd, row[index]);
                for (sum, &weight) in partial.iter_mut().zip(&weights) {
                    *sum = value.mul_add(weight, *sum);
                }
            }
        }
        for (r, partial) in partial.iter().enumerate() {
            for (o, &partial) in partial.iter().enumerate() {
                let sum = &mut sums[r * per_row + (first + o) * per_line + lane];
                *sum = (Lanes::new(simd, *sum) + partial).register();
            }
        }
    }
}

/// The sum of a line, halves added to each other.
#[inline]
pub(crate) fn sum_of_line<A: Scalar>(line: &[A]) -> A {
    // 16 values of f32 or 8 of f64 in 64 bytes.
    let mut buffer = [A::zero(); 16];
    for (to, &from) in buffer.iter_mut().zip(line) {
        *to = from;
    }
    let mut width = A::LINE;
    while width > 1 {
        width /= 2;
        for i in 0..width {
            buffer[i] += buffer[i + width];
        }
    }
    buffer[0]
}
