//! The microfacets that reflect as a model does back to the light: what the tables of a file follow.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use ndarray::ArrayView1;

use super::warp::Size;
use super::{Table, square};
use crate::brdf::{Brdf, EvalError};
use crate::geometry::{DirectionPair, Vector, cartesian, dot, polar, reflect};

/// The least density of normals, as a part of that of a surface without preference.
const MIN_DENSITY: f64 = 1e-3;
/// What the density of visible normals has beside its own, so that nothing is divided by zero: over all solid
/// angles alike, and next to the normal, where these have no area.
const MIN_VISIBLE: f64 = 1e-3;
const MIN_AT_NORMAL: f64 = 1e-6;
/// How many times as many points as visible normals call for may lie anywhere. Next to the normal of the
/// surface, where a square of the table is no area, densities that fall less fast than the area would be a
/// peak to draw.
const MAX_POINTS: f64 = 100.0;
/// Steps of the power iteration; the authors' converges in four.
const STEPS: usize = 8;

/// The distribution of normals $D$ and its projected area $\sigma$, over the unit square of a direction.
pub(super) struct Facets {
    pub(super) ndf: Table,
    pub(super) sigma: Table,
    is_isotropic: bool,
}

impl Facets {
    /// By the power iteration of the publication, section 4.2: retro-reflection is in proportion to
    /// $D(\omega) / (\sigma(\omega) \cos\theta)$, and $\sigma$ is the integral of $D(\omega_m) \max(0, \omega
    /// \cdot \omega_m)$.
    pub(super) fn of(brdf: &dyn Brdf) -> Result<Self, EvalError> {
        let is_isotropic = brdf.is_isotropic();
        let [ndf_size, sigma_size] = if is_isotropic {
            [(256, 2), (64, 2)]
        } else {
            [(128, 64), (32, 32)]
        };
        let size = |(width, height)| Size { width, height };
        let (ndf_size, sigma_size) = (size(ndf_size), size(sigma_size));
        let normals = directions(ndf_size);
        let asked: Vec<DirectionPair> = normals
            .iter()
            .map(|&normal| DirectionPair {
                incident: normal,
                outgoing: normal,
            })
            .collect();
        let values = brdf.eval(&asked)?;
        let retro = values.rows().into_iter().zip(&normals);
        let retro: Vec<f64> = retro
            .map(|(row, normal)| row.iter().copied().map(safe).sum::<f64>() * normal[2].max(0.0))
            .collect();

        let areas = areas(ndf_size);
        let towards = directions(sigma_size);
        let mut sigma = table(sigma_size, vec![1.0; towards.len()]);
        let mut density = vec![0.0; normals.len()];
        for _ in 0..STEPS {
            for ((density, &normal), retro) in density.iter_mut().zip(&normals).zip(&retro) {
                *density = retro * sigma.at(0, unit_square(normal)).max(0.0);
            }
            normalise(&mut density, &normals, &areas);
            let projected = |&direction: &Vector| {
                let all = normals.iter().zip(&density).zip(&areas);
                let parts = all.map(|((&normal, density), area)| {
                    density * area * seen(direction, normal, is_isotropic)
                });
                parts.sum::<f64>()
            };
            sigma = table(sigma_size, towards.iter().map(projected).collect());
        }
        Ok(Self {
            ndf: table(ndf_size, density),
            sigma,
            is_isotropic,
        })
    }

    /// $\sigma$ of a direction, as the tables have it.
    pub(super) fn projected_area(&self, direction: Vector) -> f64 {
        self.sigma.at(0, unit_square(direction))
    }

    /// A density of normals over a table of the unit square, which the points of the tables of values follow:
    /// half in proportion to the normals that are seen from `incident`, half to how fast
    /// $\ln(1 + f \cos\theta_o)$ changes along their elevation, so that a narrow highlight has points on its
    /// flanks. No integral is asked of it.
    pub(super) fn visible(
        &self,
        brdf: &dyn Brdf,
        incident: Vector,
        size: Size,
    ) -> Result<Vec<f32>, EvalError> {
        let area = self.projected_area(incident);
        let normals = directions(size);
        let viewers: Vec<Vector> = normals
            .iter()
            .map(|&normal| reflect(incident, normal))
            .collect();
        let pairs: Vec<DirectionPair> = viewers
            .iter()
            .map(|&viewer| DirectionPair {
                incident,
                outgoing: if viewer[2] > 0.0 { viewer } else { incident },
            })
            .collect();
        let values = brdf.eval(&pairs)?;
        let logarithms = values.rows().into_iter().zip(&viewers);
        let logarithms: Vec<f64> = logarithms
            .map(|(row, viewer)| (mean(row) * viewer[2].max(0.0)).ln_1p())
            .collect();
        let lines = logarithms.chunks_exact(size.width);
        let changed: Vec<f64> = lines.flat_map(changes).collect();
        let total = changed.iter().sum::<f64>() / changed.len() as f64;
        let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
        let all = points(size).into_iter().zip(&normals).zip(changed);
        let density = |((point, &normal), change): (([f64; 2], &Vector), f64)| {
            let facing = dot(incident, normal).max(0.0) * stretch(point);
            let seen = self.ndf.at(0, point) * facing / area;
            let changing = (scale * change).min(MAX_POINTS * seen);
            let least = MIN_VISIBLE * stretch(point) / TAU + MIN_AT_NORMAL;
            (0.5 * seen + 0.5 * changing + least) as f32
        };
        Ok(all.map(density).collect())
    }

    /// Whether tables hold one azimuth alone.
    pub(super) fn is_isotropic(&self) -> bool {
        self.is_isotropic
    }
}

/// A value that a table can hold: what is no number, infinite or negative is black, and nothing so large that
/// single precision has no room for what is computed of it.
pub(super) fn safe(value: f64) -> f64 {
    const LARGEST: f64 = 1e30;
    if value.is_finite() {
        value.clamp(0.0, LARGEST)
    } else {
        0.0
    }
}

/// The mean of all channels, as far as a table can hold them.
pub(super) fn mean(channels: ArrayView1<'_, f64>) -> f64 {
    channels.iter().copied().map(safe).sum::<f64>() / channels.len() as f64
}

/// How much values along a line change on both sides of each. None at the normal, where a line begins: there
/// the next value on its other side is the same.
fn changes(line: &[f64]) -> Vec<f64> {
    let step = |index: usize| match line.get(index..index + 2) {
        Some(&[a, b]) => (b - a).abs(),
        _ => 0.0,
    };
    let at = |index: usize| {
        if index == 0 {
            0.0
        } else {
            step(index - 1) + step(index)
        }
    };
    (0..line.len()).map(at).collect()
}

/// Where a direction lies in its unit square.
pub(super) fn unit_square(direction: Vector) -> [f64; 2] {
    let (theta, phi) = polar(direction);
    [square(theta), (phi + PI) / TAU]
}

/// The points of a table.
fn points(size: Size) -> Vec<[f64; 2]> {
    let at = |index: usize, count: usize| index as f64 / (count - 1) as f64;
    let rows = 0..size.height;
    rows.flat_map(|row| {
        (0..size.width).map(move |column| [at(column, size.width), at(row, size.height)])
    })
    .collect()
}

/// The direction that a point of the unit square stands for.
pub(super) fn direction([u, v]: [f64; 2]) -> Vector {
    cartesian(u * u * FRAC_PI_2, (2.0 * v - 1.0) * PI)
}

fn directions(size: Size) -> Vec<Vector> {
    points(size).into_iter().map(direction).collect()
}

/// The solid angle of a part of the unit square over its area.
pub(super) fn stretch([u, _]: [f64; 2]) -> f64 {
    2.0 * PI * PI * u * (u * u * FRAC_PI_2).sin()
}

/// The solid angle of each point of a table, by trapezoids.
fn areas(size: Size) -> Vec<f64> {
    let weight = |index: usize, count: usize| {
        let is_end = index == 0 || index + 1 == count;
        let whole = if is_end { 0.5 } else { 1.0 };
        whole / (count - 1) as f64
    };
    let points = points(size).into_iter().enumerate();
    points
        .map(|(index, point)| {
            let (row, column) = (index / size.width, index % size.width);
            stretch(point) * weight(column, size.width) * weight(row, size.height)
        })
        .collect()
}

/// $\max(0, \omega \cdot \omega_m)$, or its mean over the normal's azimuth.
fn seen(direction: Vector, normal: Vector, is_isotropic: bool) -> f64 {
    if !is_isotropic {
        return dot(direction, normal).max(0.0);
    }
    // The mean of max(0, a cos phi + b).
    let a = direction[0].hypot(direction[1]) * normal[0].hypot(normal[1]);
    let b = direction[2] * normal[2];
    if b >= a {
        return b;
    }
    let end = (-b / a).clamp(-1.0, 1.0).acos();
    (a * end.sin() + b * end) / PI
}

/// Gives the density of normals the projected area 1 along the normal, and its floor.
fn normalise(density: &mut [f64], normals: &[Vector], areas: &[f64]) {
    let area = |density: &[f64]| -> f64 {
        let all = density.iter().zip(normals).zip(areas);
        all.map(|((d, normal), area)| d * area * normal[2].max(0.0))
            .sum()
    };
    let total = area(density);
    let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
    for value in density.iter_mut() {
        *value = (*value * scale).max(MIN_DENSITY / PI);
    }
    let total = area(density);
    for value in density.iter_mut() {
        *value /= total;
    }
}

fn table(size: Size, numbers: Vec<f64>) -> Table {
    Table {
        size,
        numbers: numbers.into_iter().map(|number| number as f32).collect(),
    }
}
