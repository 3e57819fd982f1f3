//! Samples directions in proportion to a model, by a piecewise constant table of its values.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::distribution::Distribution2;
use elm_datasets::geometry::{DirectionPair, Vector, cartesian};

/// Viewing angles of the table.
const VIEWS: usize = 16;
/// Steps in theta_i, from the normal to the horizon.
const THETAS: usize = 24;
/// Steps in the azimuth between both directions, from 0 to pi.
const PHIS: usize = 32;
/// Steps of each cell in both angles at which the model is asked: a narrow highlight lies between the middles
/// of cells.
const STEPS: usize = 2;
/// Share of the directions that are drawn by the cosine alone, so that what the table missed is
/// found as well.
const COSINE_SHARE: f64 = 0.1;

/// Densities like a model's $f \cos\theta_i$, one for each of some viewing angles.
///
/// The model is taken to be isotropic and symmetric in the azimuth; where it is not, densities
/// stay densities, and only the noise grows.
#[derive(Debug, Clone)]
pub(crate) struct TabulatedSampler {
    views: Vec<Distribution2>,
    albedo: Vec<f64>,
}

/// What a table is made of: every pair at which the model is asked, by viewing angle.
pub(crate) struct SampleGrid {
    /// Cell by cell, by view, theta_i and azimuth; the steps of a cell one after another.
    pub(crate) cells: Vec<DirectionPair>,
    /// Mirror and retro-reflection at each viewing angle, where models peak.
    pub(crate) peaks: Vec<DirectionPair>,
}

impl SampleGrid {
    pub(crate) fn new() -> Self {
        let pair = |theta_i, phi, theta_o| DirectionPair {
            incident: cartesian(theta_i, phi),
            outgoing: cartesian(theta_o, 0.0),
        };
        let middle = |step: usize| (step as f64 + 0.5) / STEPS as f64;
        let mut cells = Vec::with_capacity(VIEWS * THETAS * PHIS * STEPS * STEPS);
        let mut peaks = Vec::with_capacity(2 * VIEWS);
        for view in 0..VIEWS {
            let theta_o = view_angle(view);
            peaks.extend([pair(theta_o, PI, theta_o), pair(theta_o, 0.0, theta_o)]);
            for theta in 0..THETAS {
                let (near, far) = cosines(theta);
                for phi in 0..PHIS {
                    for step in 0..STEPS * STEPS {
                        let cosine = near + (far - near) * middle(step / STEPS);
                        let phi = (phi as f64 + middle(step % STEPS)) / PHIS as f64 * PI;
                        cells.push(pair(cosine.acos(), phi, theta_o));
                    }
                }
            }
        }
        Self { cells, peaks }
    }
}

/// The angle that stands for a range of viewing angles.
fn view_angle(view: usize) -> f64 {
    (view as f64 + 0.5) / VIEWS as f64 * FRAC_PI_2
}

/// Cosines at both ends of a step in theta_i.
fn cosines(step: usize) -> (f64, f64) {
    let cosine = |step: usize| {
        if step == THETAS {
            0.0
        } else {
            (step as f64 / THETAS as f64 * FRAC_PI_2).cos()
        }
    };
    (cosine(step), cosine(step + 1))
}

impl TabulatedSampler {
    /// From the model's values, finite and not negative, at [`SampleGrid::cells`].
    pub(crate) fn new(values: &[f64]) -> Self {
        let (views, albedo) = values
            .chunks_exact(THETAS * PHIS * STEPS * STEPS)
            .map(|view| {
                // The integral of f cos theta over each cell, both halves of the azimuth.
                let mut weights: Vec<f64> = Vec::with_capacity(THETAS * PHIS);
                let mut cosine_weights: Vec<f64> = Vec::with_capacity(THETAS * PHIS);
                for (cell, steps) in view.chunks_exact(STEPS * STEPS).enumerate() {
                    let f = steps.iter().sum::<f64>() / (STEPS * STEPS) as f64;
                    let (near, far) = cosines(cell / PHIS);
                    let projected = (near * near - far * far) / 2.0 * TAU / PHIS as f64;
                    weights.push(f * projected);
                    cosine_weights.push(projected / PI);
                }
                let albedo: f64 = weights.iter().sum();
                let floor = COSINE_SHARE / (1.0 - COSINE_SHARE) * albedo.max(f64::MIN_POSITIVE);
                let mixed: Vec<f64> = weights
                    .iter()
                    .zip(&cosine_weights)
                    .map(|(weight, cosine)| weight + floor * cosine)
                    .collect();
                (Distribution2::new(PHIS, &mixed), albedo)
            })
            .unzip();
        Self { views, albedo }
    }

    /// Directional albedo at each of the table's viewing angles (theta_o in radians, albedo).
    pub(crate) fn albedo(&self) -> impl Iterator<Item = (f64, f64)> {
        self.albedo
            .iter()
            .enumerate()
            .map(|(view, &albedo)| (view_angle(view), albedo))
    }

    fn view(&self, outgoing: Vector) -> &Distribution2 {
        let theta = outgoing[2].clamp(0.0, 1.0).acos();
        &self.views[((theta / FRAC_PI_2 * VIEWS as f64) as usize).min(VIEWS - 1)]
    }

    /// An incident direction for a viewer at `outgoing`, with its density in solid angle.
    pub(crate) fn sample(&self, outgoing: Vector, [a, b]: [f64; 2]) -> (Vector, f64) {
        // Both halves of the azimuth alike.
        let (side, a) = if a < 0.5 {
            (1.0, 2.0 * a)
        } else {
            (-1.0, 2.0 * a - 1.0)
        };
        let ([x, y], density) = self.view(outgoing).sample([a, b]);
        let at = y * THETAS as f64;
        let step = (at as usize).min(THETAS - 1);
        let (near, far) = cosines(step);
        let cosine = near + (far - near) * (at - step as f64);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let phi = outgoing[1].atan2(outgoing[0]) + side * x * PI;
        let incident = [sine * phi.cos(), sine * phi.sin(), cosine];
        (incident, density / (THETAS as f64 * (near - far) * TAU))
    }

    /// The density in solid angle with which [`sample`](Self::sample) finds `incident`.
    pub(crate) fn density(&self, outgoing: Vector, incident: Vector) -> f64 {
        let cosine = incident[2];
        if cosine.is_nan() || cosine <= 0.0 {
            return 0.0;
        }
        let step = ((cosine.min(1.0).acos() / FRAC_PI_2 * THETAS as f64) as usize).min(THETAS - 1);
        let (near, far) = cosines(step);
        // From the viewer's own azimuth, as in `sample`: along the normal that is 0 by convention.
        let azimuth = |w: Vector| w[1].atan2(w[0]);
        let between = (azimuth(incident) - azimuth(outgoing)).abs();
        let between = between.min(TAU - between);
        let point = [between / PI, (step as f64 + 0.5) / THETAS as f64];
        self.view(outgoing).density(point) / (THETAS as f64 * (near - far) * TAU)
    }
}
