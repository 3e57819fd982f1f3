//! The networks' inputs from columns of directions. Plain loops over a block, which the compiler
//! turns into vector code; only the sets that have an angle for an input take arc tangents.

use ndarray::Array2;

use super::real::Real;
use super::{Block, Columns, ROWS};
use crate::features::Features;
use elm_datasets::geometry::DirectionPair;

/// The inputs of [`Features::Anisotropic`] whose grain has this azimuth, in radians.
#[inline(always)]
fn anisotropic<A: Real>(azimuth: f64, d: &[&[A; ROWS]; 6], x: &mut [Block<A>]) {
    let [a, b, c, e, f, g, ..] = x else { return };
    let (sin, cos) = (2.0 * azimuth).sin_cos();
    let (sin, cos) = (A::from_f64(sin), A::from_f64(cos));
    for r in 0..ROWS {
        let [ix, iy, iz, ox, oy, oz] = d.map(|part| part[r]);
        let s = Sum::of(d, r);
        let root = s.across.sqrt().atan2(s.along).sqrt();
        let (x, y) = (ix + ox, iy + oy);
        let turned = root / s.across.max(A::min_positive_value());
        a.0[r] = root;
        b.0[r] = s.cos_theta_d();
        c.0[r] = iz * oz;
        e.0[r] = s.along;
        let (along, aside) = (x * x - y * y, A::from_f64(2.0) * x * y);
        f.0[r] = turned * (cos * along + sin * aside);
        g.0[r] = turned * (cos * aside - sin * along);
    }
}

/// Fills a block for each input of the set. The same as
/// [`Features::compute`](crate::features::Features::compute) but for rounding.
#[inline(always)]
pub(super) fn compute<A: Real>(set: Features, d: &[&[A; ROWS]; 6], x: &mut [Block<A>]) {
    match (set, x) {
        (Features::Paper, [a, b, c, d0, e, f, ..]) => {
            for r in 0..ROWS {
                let [ix, iy, iz, ox, oy, oz] = d.map(|part| part[r]);
                a.0[r] = iz;
                b.0[r] = oz * iz - ox * ix - oy * iy;
                c.0[r] = iz;
                d0.0[r] = (ix * ix + iy * iy).sqrt();
                e.0[r] = oz;
                f.0[r] = (ox * ox + oy * oy).sqrt();
            }
        }
        (Features::HalfDiff, [a, b, c, e, f, ..]) => {
            for r in 0..ROWS {
                let [ix, iy, iz, ox, oy, oz] = d.map(|part| part[r]);
                let s = Sum::of(d, r);
                a.0[r] = s.across.sqrt().atan2(s.along);
                b.0[r] = s.difference.sqrt().atan2(s.length.sqrt());
                c.0[r] = s.along;
                e.0[r] = iz * oz;
                f.0[r] = ix * ox + iy * oy;
            }
        }
        (
            Features::Cosines | Features::SumDifference | Features::ReciprocalCosines,
            [a, b, c, e, ..],
        ) => {
            for r in 0..ROWS {
                let (iz, oz) = (d[2][r], d[5][r]);
                let s = Sum::of(d, r);
                a.0[r] = s.cos_theta_h();
                b.0[r] = s.cos_theta_d();
                (c.0[r], e.0[r]) = match set {
                    Features::Cosines => (iz, oz),
                    Features::SumDifference => (s.along, oz - iz),
                    _ => (s.along, iz * oz),
                };
            }
        }
        (Features::Highlight | Features::HighlightCosines, [a, b, c, e, ..]) => {
            for r in 0..ROWS {
                let (iz, oz) = (d[2][r], d[5][r]);
                let s = Sum::of(d, r);
                a.0[r] = s.across.sqrt().atan2(s.along).sqrt();
                b.0[r] = s.cos_theta_d();
                (c.0[r], e.0[r]) = match set {
                    Features::Highlight => (iz * oz, s.along),
                    _ => (iz, oz),
                };
            }
        }
        (Features::Anisotropic { .. }, x) => anisotropic(set.azimuth(), d, x),
        (Features::Algebraic, [a, b, c, ..]) => {
            for r in 0..ROWS {
                let s = Sum::of(d, r);
                // Not 0 / 0 where the two are opposite.
                let square = s.across / s.length.max(A::min_positive_value());
                a.0[r] = square.sqrt().sqrt();
                b.0[r] = s.length * A::from_f64(0.25);
                c.0[r] = d[2][r] * d[5][r];
            }
        }
        // No set has fewer inputs than its arm above takes.
        _ => {}
    }
}

/// The inputs of each pair of directions, rounded to this precision, shape (pairs, inputs).
pub(crate) fn inputs_of<A: Real>(set: Features, pairs: &[DirectionPair]) -> Array2<A> {
    let columns: Columns<A> = Columns::new(pairs);
    let mut out = Array2::zeros((pairs.len(), set.inputs().len()));
    let mut x = vec![Block::zero(); set.inputs().len()];
    for first in (0..pairs.len()).step_by(ROWS) {
        let count = ROWS.min(pairs.len() - first);
        let mut block = [[A::zero(); ROWS]; 6];
        for (to, from) in block.iter_mut().zip(&columns.components) {
            to[..count].copy_from_slice(&from[first..first + count]);
        }
        compute(set, &block.each_ref(), &mut x);
        for (input, values) in x.iter().enumerate() {
            for (row, &value) in values.0[..count].iter().enumerate() {
                out[[first + row, input]] = value;
            }
        }
    }
    out
}

/// The sum of light and viewer, and how far apart they are.
struct Sum<A> {
    /// Component along the normal.
    along: A,
    /// The square of the part in the plane of the surface.
    across: A,
    /// The square of the whole.
    length: A,
    /// The square of the difference.
    difference: A,
}

impl<A: Real> Sum<A> {
    #[inline(always)]
    fn of(d: &[&[A; ROWS]; 6], r: usize) -> Self {
        let [ix, iy, iz, ox, oy, oz] = d.map(|part| part[r]);
        let (sx, sy, sz) = (ix + ox, iy + oy, iz + oz);
        let (dx, dy, dz) = (ix - ox, iy - oy, iz - oz);
        let across = sx * sx + sy * sy;
        Self {
            along: sz,
            across,
            length: across + sz * sz,
            difference: dx * dx + dy * dy + dz * dz,
        }
    }

    #[inline(always)]
    fn cos_theta_h(&self) -> A {
        if self.length > A::zero() {
            self.along / self.length.sqrt()
        } else {
            A::one()
        }
    }

    #[inline(always)]
    fn cos_theta_d(&self) -> A {
        // Of unit vectors: the two squares add up to 4.
        (self.length / (self.length + self.difference)).sqrt()
    }
}
