//! Prepares any [`Brdf`] for rendering: bounds its values, and samples directions in proportion to
//! them.

use ndarray::ArrayViewMut2;

use crate::error::{Error, Result};
use crate::vector::{Rgb, largest, luminance, scaled, times};
use elm_datasets::Brdf;
use elm_datasets::geometry::{DirectionPair, Vector};
use elm_datasets::mixture::LobeMixture;

/// A model may pass the largest value of the directions asked by this factor; beyond, it is cut off.
const CEILING_MARGIN: f64 = 2.0;

/// A reflectance model ready for rendering.
///
/// Values are never negative, never without number, and never above a ceiling, twice the largest
/// value among some thousand directions, mirror and retro-reflection included. That bound lets
/// the renderer leave out what cannot be seen.
///
/// ```
/// use elm_datasets::geometry::{DirectionPair, cartesian};
/// use elm_brdf_render::Material;
/// use elm_datasets::lobes::Formula;
/// let chalk = Material::new(Box::new(Formula::lambert(0.8)?), [1.0; 3], false)?;
/// let outgoing = cartesian(0.5, 0.0);
/// let (incident, density) = chalk.sample(outgoing, [0.3, 0.7]);
/// assert!((chalk.pdf(outgoing, incident) / density - 1.0).abs() < 1e-9);
/// let value = chalk.eval(&[DirectionPair { incident, outgoing }])?[0][0];
/// assert!((value - 0.8 / std::f64::consts::PI).abs() < 1e-12);
/// assert!((chalk.albedo()[0].1 - 0.8).abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Material {
    brdf: Box<dyn Brdf>,
    /// Factor on each channel.
    factor: Rgb,
    max_value: f64,
    sampler: LobeMixture,
    /// As luminance before any rescaling, by viewing angle.
    albedo: Vec<(f64, f64)>,
    /// Of any channel at any angle.
    largest_albedo: f64,
    /// Factor that keeps the albedo from passing 1; 1 where that was not asked for or needed.
    scale: f64,
}

impl Material {
    /// Prepares a model of one channel or three; `tint` multiplies it. With `conserve_energy` it
    /// is scaled down so that no directional albedo passes 1.
    ///
    /// # Errors
    /// [`Error::Channels`] for a model of another number of channels, [`Error::Tint`]; whatever the
    /// model's own evaluation reports.
    pub fn new(brdf: Box<dyn Brdf>, tint: Rgb, conserve_energy: bool) -> Result<Self> {
        let channels = brdf.channels();
        if channels != 1 && channels != 3 {
            return Err(Error::Channels { channels });
        }
        if !tint.iter().all(|c| (0.0..=1e6).contains(c)) {
            return Err(Error::Tint { found: tint });
        }
        let raw = |pairs: &[DirectionPair]| -> Result<Vec<Rgb>> {
            let mut room = Vec::new();
            evaluate(&*brdf, pairs, &mut room)?;
            let rows = room.chunks_exact(channels);
            Ok(rows.map(|row| color(row, f64::INFINITY)).collect())
        };
        let gray = |values: &[Rgb]| -> Vec<f64> {
            let tinted = values.iter().map(|&value| times(value, tint));
            tinted.map(luminance).collect()
        };
        let isotropic = brdf.is_isotropic();
        let pilot = LobeMixture::pilot(isotropic);
        let first = raw(pilot.pairs())?;
        let sampler = LobeMixture::fit(&pilot, &gray(&first), isotropic);
        let points = sampler.points();
        let values = raw(points.pairs())?;
        let highest = first
            .iter()
            .chain(&values)
            .chain(&raw(&LobeMixture::peaks())?)
            .map(|&value| largest(value))
            .fold(0.0, f64::max);
        let albedo = points.albedo(&gray(&values));
        let largest_albedo = (0..3)
            .flat_map(|channel| {
                let values: Vec<f64> = values.iter().map(|v| v[channel] * tint[channel]).collect();
                points.albedo(&values)
            })
            .map(|(_, albedo)| albedo)
            .fold(0.0, f64::max);
        let scale = if conserve_energy && largest_albedo > 1.0 {
            1.0 / largest_albedo
        } else {
            1.0
        };
        Ok(Self {
            brdf,
            factor: scaled(tint, scale),
            max_value: CEILING_MARGIN * highest,
            sampler,
            albedo,
            largest_albedo,
            scale,
        })
    }

    /// BRDF in 1/sr of each pair, as linear red, green and blue.
    ///
    /// # Errors
    /// Whatever the model's own evaluation reports.
    pub fn eval(&self, pairs: &[DirectionPair]) -> Result<Vec<Rgb>> {
        let mut values = Vec::new();
        self.eval_into(pairs, &mut Vec::new(), &mut values)?;
        Ok(values)
    }

    /// As [`eval`](Self::eval), in place of what is in `values`. What is in `room` does not matter; kept from
    /// one call to the next, both save allocations.
    pub(crate) fn eval_into(
        &self,
        pairs: &[DirectionPair],
        room: &mut Vec<f64>,
        values: &mut Vec<Rgb>,
    ) -> Result<()> {
        evaluate(&*self.brdf, pairs, room)?;
        values.clear();
        let rows = room.chunks_exact(self.channels());
        values.extend(rows.map(|row| times(color(row, self.max_value), self.factor)));
        Ok(())
    }

    /// Draws an incident direction for a viewer at `outgoing`, from two numbers in \[0, 1), with
    /// its density in solid angle: about in proportion to the model times the cosine.
    #[must_use]
    pub fn sample(&self, outgoing: Vector, u: [f64; 2]) -> (Vector, f64) {
        self.sampler.sample(outgoing, u)
    }

    /// The density in solid angle of [`sample`](Self::sample).
    #[must_use]
    pub fn pdf(&self, outgoing: Vector, incident: Vector) -> f64 {
        self.sampler.density(outgoing, incident)
    }

    /// Directional albedo, as luminance: the part of light from `theta_o` (radians) that is
    /// reflected, for each of some angles (theta_o, albedo). The mean over all azimuths.
    #[must_use]
    pub fn albedo(&self) -> Vec<(f64, f64)> {
        let scaled = |&(theta_o, albedo)| (theta_o, self.scale * albedo);
        self.albedo.iter().map(scaled).collect()
    }

    /// The largest directional albedo of any channel before any rescaling; above 1 the model
    /// creates energy.
    #[must_use]
    pub fn largest_albedo(&self) -> f64 {
        self.largest_albedo
    }

    /// Whether it was scaled down so that no albedo passes 1.
    #[must_use]
    pub(crate) fn is_rescaled(&self) -> bool {
        self.scale < 1.0
    }

    /// No value of [`eval`](Self::eval) is larger, channel by channel.
    #[must_use]
    pub fn max_value(&self) -> Rgb {
        scaled(self.factor, self.max_value)
    }

    /// Whether turning the surface about its normal changes nothing.
    #[must_use]
    pub fn is_isotropic(&self) -> bool {
        self.brdf.is_isotropic()
    }

    /// Number of channels that are evaluated.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.brdf.channels()
    }
}

impl std::fmt::Debug for Material {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Material")
            .field("channels", &self.channels())
            .field("ceiling", &self.max_value)
            .field("largest_albedo", &self.largest_albedo)
            .finish_non_exhaustive()
    }
}

/// The values of each pair, one pair after another, in place of what is in `room`.
fn evaluate(brdf: &dyn Brdf, pairs: &[DirectionPair], room: &mut Vec<f64>) -> Result<()> {
    let shape = (pairs.len(), brdf.channels());
    room.clear();
    room.resize(shape.0 * shape.1, 0.0);
    if let Ok(view) = ArrayViewMut2::from_shape(shape, &mut room[..]) {
        brdf.eval_into(pairs, view)?;
    }
    Ok(())
}

/// One or three values as a colour between 0 and `max_value`.
fn color(values: &[f64], max_value: f64) -> Rgb {
    // In this order also no number becomes 0, and infinity the ceiling.
    let safe = |value: f64| value.max(0.0).min(max_value);
    let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
    match *values {
        [r, g, b] => [r, g, b].map(|value| finite(safe(value))),
        _ => [finite(safe(values[0])); 3],
    }
}
