//! Where the values of a slice of a file lie, and what directions are drawn by.

use std::f64::consts::PI;

use super::facets::{Facets, direction, stretch};
use super::warp::{Size, Warp};
use crate::geometry::{DirectionPair, Vector, dot, reflect};

/// The part of what is drawn that is drawn as a white surface reflects, which leaves no direction out.
const DRAWN_AS_WHITE: f64 = 1e-3;
/// The least luminance over its mean, so that nothing is divided by zero.
const MIN_LUMINANCE: f64 = 1e-6;

/// The points of a slice of the tables of values.
pub(super) struct Points {
    pub(super) pairs: Vec<DirectionPair>,
    /// What a table has, over the BRDF.
    pub(super) scales: Vec<f64>,
    /// The projected solid angle of the viewer over the area of the table.
    angles: Vec<f64>,
}

impl Points {
    pub(super) fn new(
        facets: &Facets,
        warp: &Warp,
        size: Size,
        (slice, light): (usize, Vector),
    ) -> Self {
        let mut points = Self {
            pairs: Vec::with_capacity(size.area()),
            scales: Vec::with_capacity(size.area()),
            angles: Vec::with_capacity(size.area()),
        };
        let area = 4.0 * facets.projected_area(light);
        let at = |index: usize, count: usize| index as f64 / (count - 1) as f64;
        for index in 0..size.area() {
            let (column, row) = (index % size.width, index / size.width);
            let seen = warp.unflatten(slice, [at(column, size.width), at(row, size.height)]);
            let normal = direction(seen);
            let viewer = reflect(light, normal);
            let is_above = viewer[2] > 0.0;
            let cosine = viewer[2].max(0.0);
            points.scales.push(area * cosine / facets.ndf.at(0, seen));
            // Of the normal over the table, of the viewer over the normal. The normal of the surface has
            // neither area nor density; their ratio is that of the next point.
            let near = [seen[0].max(1.0 / (warp.size().width - 1) as f64), seen[1]];
            let normals = stretch(near) / warp.density(slice, near);
            let viewers = 4.0 * dot(light, normal).max(0.0);
            points.angles.push(normals * viewers * cosine);
            points.pairs.push(DirectionPair {
                incident: light,
                outgoing: if is_above { viewer } else { light },
            });
        }
        points
    }

    /// What directions are drawn by: in proportion to $f \cos\theta_o$ for these means of the channels.
    pub(super) fn luminance(&self, means: &[f64]) -> Vec<f32> {
        let mean = |of: &dyn Fn(f64, f64) -> f64| {
            let all = means.iter().zip(&self.angles);
            all.map(|(&f, &angle)| of(f, angle)).sum::<f64>() / means.len() as f64
        };
        let albedo = mean(&|f, angle| f * angle);
        let white = if albedo > 0.0 {
            DRAWN_AS_WHITE * albedo / PI
        } else {
            1.0
        };
        let least = MIN_LUMINANCE * mean(&|f, angle| (f + white) * angle);
        let all = means.iter().zip(&self.angles);
        all.map(|(f, angle)| ((f + white) * angle).max(least) as f32)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use ndarray::ArrayViewMut2;

    use super::super::facets::{mean, unit_square};
    use super::super::warp::Blend;
    use super::*;
    use crate::brdf::{Brdf, EvalError};
    use crate::geometry::{cartesian, half_vector};
    use crate::lobes;

    struct Plastic;

    impl Brdf for Plastic {
        fn channels(&self) -> usize {
            1
        }

        fn is_isotropic(&self) -> bool {
            true
        }

        fn eval_into(
            &self,
            pairs: &[DirectionPair],
            mut values: ArrayViewMut2<'_, f64>,
        ) -> Result<(), EvalError> {
            for (mut row, pair) in values.rows_mut().into_iter().zip(pairs) {
                row[0] = 0.3 / PI + lobes::ggx(pair, 0.05, 0.15);
            }
            Ok(())
        }
    }

    #[test]
    fn directions_are_drawn_in_proportion_to_what_they_reflect() {
        let size = |width, height| Size { width, height };
        let facets = Facets::of(&Plastic).unwrap();
        let table = size(64, 64);
        let one: Blend = [(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
        for theta in [0.0, 0.5, 1.1] {
            let light = cartesian(theta, 0.0);
            let visible = facets.visible(&Plastic, light, size(128, 32)).unwrap();
            let normals = Warp::new(size(128, 32), visible.into_iter()).unwrap();
            let points = Points::new(&facets, &normals, table, (0, light));
            let values = Plastic.eval(&points.pairs).unwrap();
            let means: Vec<f64> = values.rows().into_iter().map(mean).collect();
            let drawn = Warp::new(table, points.luminance(&means).into_iter()).unwrap();
            let mut ratios = Vec::new();
            for index in 1..=400_u32 {
                let [a, b] = [0.754_877_666, 0.569_840_29].map(|s| (f64::from(index) * s).fract());
                let viewer = cartesian(1.5 * a, TAU * b);
                let normal = half_vector(light, viewer).unwrap();
                let seen = unit_square(normal);
                let angles = 4.0 * dot(light, normal) * stretch(seen);
                let flat = normals.flatten(&one, seen);
                let density = drawn.density(0, flat) * normals.density(0, seen) / angles;
                let pair = DirectionPair {
                    incident: light,
                    outgoing: viewer,
                };
                let reflected = Plastic.eval(&[pair]).unwrap()[[0, 0]] * viewer[2];
                ratios.push(reflected / density);
            }
            // Of interpolation between points; the albedo, were there no error.
            ratios.sort_by(f64::total_cmp);
            let [low, middle, high] = [20, 200, 380].map(|rank| ratios[rank]);
            assert!(
                low > 0.9 * middle && high < 1.1 * middle,
                "{theta}: {low} {middle} {high}"
            );
            assert!(ratios[399] < 2.0 * middle, "{theta}: {}", ratios[399]);
        }
    }
}
