//! Squared distances of rows from the centers of radial neurons.

use ndarray::{Array2, ArrayView2};
use pulp::{Simd, WithSimd};

use crate::scalar::Scalar;
use crate::simd::{Lanes, Level};

/// The distance of each row of `x`, shape (rows, inputs), from each column of `centers`, shape
/// (inputs, neurons).
///
/// By differences, not by $\lVert x \rVert^2 - 2 x \cdot c + \lVert c \rVert^2$, which would be one
/// product but lose the digits of everything near a center: with unit roundoff $u$ a distance $z$
/// has an error of at most $(d / 2 + 2) u z$ in $d$ inputs, beside $u (\lVert x \rVert + \lVert c
/// \rVert)$ from rounding `x` and `centers` to begin with; and a row is at distance 0 from itself.
pub(super) fn distances<A: Scalar>(x: ArrayView2<'_, A>, centers: ArrayView2<'_, A>) -> Array2<A> {
    // Whole registers, whatever the vector unit's width.
    let neurons = centers.ncols();
    let padded = neurons.next_multiple_of(A::LINE);
    let mut to = Array2::zeros((x.nrows(), padded));
    let mut lines = Array2::zeros((centers.nrows(), padded));
    lines.slice_mut(ndarray::s![.., ..neurons]).assign(&centers);
    let level = Level::best();
    for (x, mut to) in x.rows().into_iter().zip(to.rows_mut()) {
        if let (Some(lines), Some(to)) = (lines.as_slice(), to.as_slice_mut()) {
            level.run(Distances {
                x: x.iter(),
                lines,
                to,
            });
        }
    }
    to.slice_move(ndarray::s![.., ..neurons])
}

struct Distances<'a, A, I> {
    x: I,
    /// For each input the centers' coordinates.
    lines: &'a [A],
    to: &'a mut [A],
}

impl<'a, A: Scalar, I: Iterator<Item = &'a A>> WithSimd for Distances<'_, A, I> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let length = self.to.len();
        let to = A::registers_mut::<S>(self.to).0;
        for (&x, line) in self.x.zip(self.lines.chunks_exact(length.max(1))) {
            let x = Lanes::<S, A>::splat(simd, x);
            for (sum, &center) in to.iter_mut().zip(A::registers::<S>(line).0) {
                let apart = x - Lanes::new(simd, center);
                *sum = apart.mul_add(apart, Lanes::new(simd, *sum)).register();
            }
        }
        for sum in to {
            *sum = Lanes::<S, A>::new(simd, *sum).sqrt().register();
        }
    }
}
