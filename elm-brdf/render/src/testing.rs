//! Checks that every reflectance model must pass before pictures of it can be trusted: draws
//! follow their density, sampling and quadrature agree on the albedo, exchanged directions give
//! the same value.
//!
//! Each check returns what it measured, so that a test can state its own bound. Random numbers
//! come from the caller: `random` returns independent uniform numbers in \[0, 1).
//!
//! ```
//! use elm_brdf_render::{Material, testing};
//! use elm_datasets::geometry::{DirectionPair, cartesian};
//! use elm_datasets::lobes::Formula;
//! # // Weyl's sequence by the golden ratio and the square root of two, mixed.
//! # let mut state = 0u64;
//! # let mut random = || {
//! #     state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
//! #     let mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
//! #     let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
//! #     ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1u64 << 53) as f64
//! # };
//! let plastic = Formula::lambert(0.5)?.with_ggx(0.04, 0.3)?;
//! let outgoing = cartesian(0.8, 0.3);
//! let pairs = [DirectionPair { incident: cartesian(0.2, 1.0), outgoing }];
//! assert!(testing::reciprocity(&plastic, &pairs)? < 1e-12);
//!
//! let material = Material::new(Box::new(plastic), [1.0; 3], false)?;
//! let fit = testing::chi_square(&material, outgoing, &mut random);
//! assert!(fit.statistic < fit.limit);
//! let furnace = testing::white_furnace(&material, outgoing, &mut random)?;
//! assert!((furnace.sampled - furnace.quadrature).abs() < 5.0 * furnace.standard_error + 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::f64::consts::{FRAC_PI_2, TAU};

use elm_datasets::Brdf;
use elm_datasets::geometry::{DirectionPair, Vector, cartesian, polar};

use crate::error::Result;
use crate::material::Material;
use crate::vector::luminance;

/// What [`chi_square`] found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChiSquare {
    /// Pearson's statistic of the counts against the density's integral over each bin.
    pub statistic: f64,
    /// The statistic that a right sampler passes once in three million times.
    pub limit: f64,
    /// The density's integral over the hemisphere; 1 for a right density.
    pub total: f64,
    /// The largest relative difference between the density that
    /// [`sample`](Material::sample) returned and [`pdf`](Material::pdf) of its direction.
    pub density_error: f64,
}

/// Draws 5000 directions for a viewer at `outgoing` and counts them in 6 x 8 bins of angles, equal
/// in theta and in phi about the viewer.
pub fn chi_square(
    material: &Material,
    outgoing: Vector,
    random: &mut dyn FnMut() -> f64,
) -> ChiSquare {
    const THETAS: usize = 6;
    const PHIS: usize = 8;
    // The tenth of all draws that follow the cosine gives the emptiest bin, at the horizon, four.
    const DRAWS: usize = 5000;
    let phi_o = polar(outgoing).1;
    let mut counts = [0.0; THETAS * PHIS];
    let mut density_error = 0.0_f64;
    for _ in 0..DRAWS {
        let (w, density) = material.sample(outgoing, [random(), random()]);
        density_error = density_error.max((material.pdf(outgoing, w) / density - 1.0).abs());
        let theta = w[2].acos() / FRAC_PI_2 * THETAS as f64;
        let phi = (w[1].atan2(w[0]) - phi_o).rem_euclid(TAU) / TAU * PHIS as f64;
        counts[(theta as usize).min(THETAS - 1) * PHIS + (phi as usize).min(PHIS - 1)] += 1.0;
    }
    let (mut statistic, mut total) = (0.0, 0.0);
    for (bin, count) in counts.iter().enumerate() {
        let theta = |step: usize| (bin / PHIS + step) as f64 / THETAS as f64 * FRAC_PI_2;
        let phi = |step: usize| phi_o + (bin % PHIS + step) as f64 / PHIS as f64 * TAU;
        let thetas = (theta(0), theta(1));
        let share = integral(material, outgoing, thetas, (phi(0), phi(1)));
        total += share;
        let expected = share * DRAWS as f64;
        statistic += (count - expected) * (count - expected) / expected;
    }
    // Wilson and Hilferty's approximation: the cube root of chi-square over its degrees of
    // freedom is normal. Five deviations are passed once in three million.
    let freedom = (THETAS * PHIS - 1) as f64;
    let spread = 2.0 / (9.0 * freedom);
    ChiSquare {
        statistic,
        limit: freedom * (1.0 - spread + 5.0 * spread.sqrt()).powi(3),
        total,
        density_error,
    }
}

/// The density's integral over a range of angles, by midpoints in the cosine and in phi, denser towards both
/// ends in phi: the viewer's plane, where lobes are narrow at grazing angles, lies between two bins.
fn integral(
    material: &Material,
    outgoing: Vector,
    thetas: (f64, f64),
    (phi, phi_end): (f64, f64),
) -> f64 {
    const THETAS: usize = 32;
    const PHIS: usize = 32;
    let cosine = |t: usize| (thetas.0 + (thetas.1 - thetas.0) * t as f64 / THETAS as f64).cos();
    let azimuth = |p: f64| {
        let t = p / PHIS as f64;
        phi + (phi_end - phi) * t * t * (3.0 - 2.0 * t)
    };
    let mut sum = 0.0;
    for t in 0..THETAS {
        let (near, far) = (cosine(t), cosine(t + 1));
        for p in 0..PHIS {
            let p = p as f64;
            let incident = cartesian(((near + far) / 2.0).acos(), azimuth(p + 0.5));
            let area = (near - far) * (azimuth(p + 1.0) - azimuth(p));
            sum += material.pdf(outgoing, incident) * area;
        }
    }
    sum
}

/// What [`white_furnace`] found: the part of light from everywhere that is sent towards the viewer,
/// as luminance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Furnace {
    /// By midpoints in both angles, 90 x 72 cells.
    pub quadrature: f64,
    /// By 1000 sampled directions.
    pub sampled: f64,
    /// Standard error of `sampled`.
    pub standard_error: f64,
}

/// What a surface sends towards `outgoing` where light of radiance 1 comes from everywhere, found
/// in two ways that share nothing but the model.
///
/// # Errors
/// Whatever the model's own evaluation reports.
pub fn white_furnace(
    material: &Material,
    outgoing: Vector,
    random: &mut dyn FnMut() -> f64,
) -> Result<Furnace> {
    const DRAWS: usize = 1000;
    // Cells of a degree in theta, because lobes are narrow.
    const THETAS: usize = 90;
    const PHIS: usize = 72;
    let weighted = |pairs: &[DirectionPair], weights: &[f64]| -> Result<Vec<f64>> {
        let values = material.eval(pairs)?;
        let values = values.iter().zip(weights);
        Ok(values.map(|(&f, weight)| luminance(f) * weight).collect())
    };
    let step = FRAC_PI_2 / THETAS as f64;
    let phi_o = polar(outgoing).1;
    let cells = (0..THETAS * PHIS).map(|cell| {
        let theta = ((cell / PHIS) as f64 + 0.5) * step;
        let phi = phi_o + ((cell % PHIS) as f64 + 0.5) / PHIS as f64 * TAU;
        let incident = cartesian(theta, phi);
        let area = theta.sin() * theta.cos() * step * TAU / PHIS as f64;
        (DirectionPair { incident, outgoing }, area)
    });
    let (pairs, areas): (Vec<DirectionPair>, Vec<f64>) = cells.unzip();
    let quadrature = weighted(&pairs, &areas)?.iter().sum();

    let draws = (0..DRAWS).map(|_| {
        let (incident, density) = material.sample(outgoing, [random(), random()]);
        (DirectionPair { incident, outgoing }, incident[2] / density)
    });
    let (pairs, factors): (Vec<DirectionPair>, Vec<f64>) = draws.unzip();
    let values = weighted(&pairs, &factors)?;
    let n = DRAWS as f64;
    let sampled = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - sampled).powi(2)).sum::<f64>() / (n - 1.0);
    Ok(Furnace {
        quadrature,
        sampled,
        standard_error: (variance / n).sqrt(),
    })
}

/// The largest difference between the values of a pair and of the same with light and viewer
/// exchanged, over the larger of the two in size; 0 for a reciprocal model, up to rounding.
///
/// # Errors
/// Whatever the model's own evaluation reports.
pub fn reciprocity(brdf: &dyn Brdf, pairs: &[DirectionPair]) -> Result<f64> {
    let swapped: Vec<DirectionPair> = pairs.iter().map(|pair| pair.swapped()).collect();
    let (values, exchanged) = (brdf.eval(pairs)?, brdf.eval(&swapped)?);
    let both = values.iter().zip(&exchanged);
    let differences = both.map(|(a, b)| {
        let size = a.abs().max(b.abs());
        if size > 0.0 {
            (a - b).abs() / size
        } else {
            0.0
        }
    });
    Ok(differences.fold(0.0, f64::max))
}
