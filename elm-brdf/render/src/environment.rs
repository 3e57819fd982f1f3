//! Light from infinity: constant, or a picture in latitude and longitude.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use crate::distribution::Distribution2;
use crate::error::{Error, Result};
use crate::vector::{Rgb, ShadingFrame, Vec3, largest, luminance, scaled, times};
use elm_datasets::geometry::Vector;

/// Most pixels of a picture of the environment.
const MAX_PIXELS: u64 = 1 << 25;

/// Radiance from every direction.
#[derive(Debug, Clone)]
pub(crate) struct Environment {
    /// Radiance, or factor on the panorama.
    pub(crate) radiance: Rgb,
    pub(crate) panorama: Option<EnvironmentMap>,
    /// Whether rays from the camera see it.
    pub(crate) visible: bool,
}

/// A picture in latitude and longitude.
#[derive(Debug, Clone)]
pub(crate) struct EnvironmentMap {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
    distribution: Distribution2,
    /// Turn about the vertical as a part of a full turn.
    turn: f64,
}

/// A direction to a light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightSample {
    pub(crate) direction: Vec3,
    /// How far the way must be free.
    pub(crate) distance: f64,
    /// What arrives: radiance over density, or irradiance across the direction for a light
    /// without extent.
    pub(crate) irradiance: Rgb,
    /// Density in solid angle; `None` for a light without extent, which no other way of sampling
    /// can find.
    pub(crate) density: Option<f64>,
}

impl Environment {
    /// Radiance from a direction.
    pub(crate) fn radiance(&self, direction: Vec3) -> Rgb {
        self.panorama.as_ref().map_or(self.radiance, |panorama| {
            times(self.radiance, panorama.look(direction))
        })
    }

    /// Density in solid angle of [`sample`](Self::sample) at a surface with this normal.
    pub(crate) fn density(&self, normal: Vec3, direction: Vec3) -> f64 {
        match &self.panorama {
            Some(panorama) => panorama.density(direction),
            None => normal.dot(&direction).max(0.0) / PI,
        }
    }

    /// By the brightness of the picture; a constant one by the cosine.
    pub(crate) fn sample(&self, normal: Vec3, u: [f64; 2]) -> Option<LightSample> {
        let (direction, density) = match &self.panorama {
            Some(panorama) => panorama.sample(u),
            None => {
                let local = cosine_weighted(u);
                (
                    ShadingFrame::from_normal(normal).world(local),
                    local[2] / PI,
                )
            }
        };
        let radiance = self.radiance(direction);
        (density > 0.0 && largest(radiance) > 0.0).then(|| LightSample {
            direction,
            distance: f64::INFINITY,
            irradiance: scaled(radiance, 1.0 / density),
            density: Some(density),
        })
    }
}

/// A direction above the horizon, with density cosine / pi.
pub(crate) fn cosine_weighted([a, b]: [f64; 2]) -> Vector {
    let radius = a.sqrt();
    let (sin, cos) = (TAU * b).sin_cos();
    [radius * cos, radius * sin, (1.0 - a).max(0.0).sqrt()]
}

impl EnvironmentMap {
    /// Reads OpenEXR or Radiance HDR (or any picture that the decoder knows).
    pub(crate) fn read(path: &Path, rotation: f64) -> Result<Self> {
        let wrong = |reason: String| Error::Picture {
            path: path.to_owned(),
            reason,
        };
        let open = || {
            image::ImageReader::open(path)
                .and_then(image::ImageReader::with_guessed_format)
                .map_err(|reason| Error::Read {
                    path: path.to_owned(),
                    reason,
                })
        };
        let (width, height) = open()?
            .into_dimensions()
            .map_err(|e| wrong(e.to_string()))?;
        if u64::from(width) * u64::from(height) > MAX_PIXELS || width == 0 || height == 0 {
            return Err(wrong(format!(
                "it has {width} x {height} pixels, expected 1 to {MAX_PIXELS}"
            )));
        }
        let picture = open()?
            .decode()
            .map_err(|e| wrong(e.to_string()))?
            .into_rgb32f();
        let pixels: Vec<[f32; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
        if let Some(bad) = pixels
            .iter()
            .position(|pixel| !pixel.iter().all(|c| c.is_finite() && *c >= 0.0))
        {
            let (x, y) = (bad % width as usize, bad / width as usize);
            return Err(wrong(format!(
                "pixel ({x}, {y}) is {:?}, expected finite radiance",
                pixels[bad]
            )));
        }
        Ok(Self::new(width as usize, pixels, rotation))
    }

    /// A photographer's studio: a dim room, a large lamp on the left, a narrow one on the right and
    /// a soft one above.
    pub(crate) fn studio(rotation: f64) -> Self {
        let (width, height) = (512, 256);
        // Smooth edges of some degrees keep the lamps from ringing in reflections.
        let edge = |distance: f64| 1.0 / (1.0 + (distance / 0.02).exp());
        let lamp = |phi: f64, theta: f64, at: [f64; 2], half: [f64; 2]| {
            edge((phi - at[0]).abs() - half[0]) * edge((theta - at[1]).abs() - half[1])
        };
        let mut pixels = Vec::with_capacity(width * height);
        for row in 0..height {
            let theta = (row as f64 + 0.5) / height as f64 * PI;
            for column in 0..width {
                // 0 behind the subject, +-pi behind the camera.
                let phi = (column as f64 + 0.5) / width as f64 * TAU - PI;
                let wall = 0.12 + 0.16 * (0.5 + 0.5 * theta.cos()).powi(2);
                let key = 9.0 * lamp(phi, theta, [-2.0, 1.05], [0.42, 0.32]);
                let rim = 6.0 * lamp(phi, theta, [1.2, 1.25], [0.12, 0.55]);
                let top = 2.5 * edge(theta - 0.45);
                let color = [
                    wall + key + 0.8 * rim + top,
                    wall * 1.02 + 0.96 * key + 0.9 * rim + top,
                    wall * 1.08 + 0.88 * key + rim + top,
                ];
                pixels.push(color.map(|c| c as f32));
            }
        }
        Self::new(width, pixels, rotation)
    }

    fn new(width: usize, pixels: Vec<[f32; 3]>, rotation: f64) -> Self {
        let height = pixels.len() / width;
        let mut panorama = Self {
            width,
            height,
            distribution: Distribution2::new(width, &vec![1.0; pixels.len()]),
            pixels,
            turn: rotation / 360.0,
        };
        let weights: Vec<f64> = (0..panorama.pixels.len())
            .map(|cell| {
                let (column, row) = (cell % width, cell / width);
                // Interpolation carries light into the neighbouring cells.
                let around: f64 = [-1, 0, 1]
                    .into_iter()
                    .flat_map(|dy| [-1, 0, 1].map(|dx| (dx, dy)))
                    .map(|(dx, dy)| {
                        luminance(panorama.pixel(column as isize + dx, row as isize + dy))
                    })
                    .sum();
                around * ((row as f64 + 0.5) / height as f64 * PI).sin()
            })
            .collect();
        panorama.distribution = Distribution2::new(width, &weights);
        panorama
    }

    /// A pixel; columns go around, rows end.
    fn pixel(&self, column: isize, row: isize) -> Rgb {
        let column = column.rem_euclid(self.width as isize) as usize;
        let row = row.clamp(0, self.height as isize - 1) as usize;
        self.pixels[row * self.width + column].map(f64::from)
    }

    /// Radiance from a direction, interpolated between pixels.
    fn look(&self, direction: Vec3) -> Rgb {
        let [x, y] = self.point(direction);
        let (x, y) = (x * self.width as f64 - 0.5, y * self.height as f64 - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (s, t) = (x - left, y - top);
        let pixel = |dx, dy| self.pixel(left as isize + dx, top as isize + dy);
        let mut sum = scaled(pixel(0, 0), (1.0 - s) * (1.0 - t));
        for (dx, dy, weight) in [(1, 0, s * (1.0 - t)), (0, 1, (1.0 - s) * t), (1, 1, s * t)] {
            super::vector::add(&mut sum, scaled(pixel(dx, dy), weight));
        }
        sum
    }

    /// Where in the unit square a direction lies.
    fn point(&self, direction: Vec3) -> [f64; 2] {
        let phi = direction.x.atan2(-direction.z);
        let across = (phi / TAU + 0.5 + self.turn).rem_euclid(1.0);
        [across, direction.y.clamp(-1.0, 1.0).acos() / PI]
    }

    fn density(&self, direction: Vec3) -> f64 {
        let sin = direction.x.hypot(direction.z);
        let point = self.point(direction);
        // A step across covers 2 pi sin theta, a step down pi.
        if sin > 0.0 {
            self.distribution.density(point) / (2.0 * PI * PI * sin)
        } else {
            0.0
        }
    }

    fn sample(&self, u: [f64; 2]) -> (Vec3, f64) {
        let ([across, down], density) = self.distribution.sample(u);
        let (sin_phi, cos_phi) = ((across - 0.5 - self.turn) * TAU).sin_cos();
        let (sin, cos) = (down * PI).sin_cos();
        let direction = Vec3::new(sin * sin_phi, cos, -sin * cos_phi);
        let density = if sin > 0.0 {
            density / (2.0 * PI * PI * sin)
        } else {
            0.0
        };
        (direction, density)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of radiance over density: the integral over all directions.
    fn integral(environment: &Environment, value: impl Fn(Vec3) -> f64) -> f64 {
        let n = 400;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let u = [(i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64];
                if let Some(sample) = environment.sample(Vec3::y(), u) {
                    let density = environment.density(Vec3::y(), sample.direction);
                    // Unless a rounding error moves the direction to the next cell.
                    let ratio = density / sample.density.unwrap();
                    assert!((ratio - 1.0).abs() < 1e-6 || sample.direction.y.abs() < 1.0);
                    sum += sample.irradiance[0] * value(sample.direction) / (n * n) as f64;
                }
            }
        }
        sum
    }

    #[test]
    fn the_irradiance_under_a_constant_sky_is_pi() {
        let sky = Environment {
            radiance: [1.0; 3],
            panorama: None,
            visible: true,
        };
        // Every term is pi up to rounding, and 160,000 of them are added.
        assert!((integral(&sky, |w| w.y.max(0.0)) - PI).abs() < 160_000.0 * f64::EPSILON * PI);
    }

    #[test]
    fn a_white_panorama_covers_the_sphere_and_lights_like_the_sky() {
        let sky = Environment {
            radiance: [1.0; 3],
            panorama: Some(EnvironmentMap::new(64, vec![[1.0; 3]; 64 * 32], 30.0)),
            visible: true,
        };
        // Within a row the integrand runs from sin theta at one end to that at the other, over that
        // in the middle: 0 to 2 next to the poles, 8 in total variation. The midpoint rule with
        // 400 points errs by no more than that over 800.
        assert!((integral(&sky, |_| 1.0) / (4.0 * PI) - 1.0).abs() < 0.01);
        assert!((integral(&sky, |w| w.y.max(0.0)) / PI - 1.0).abs() < 0.01);
    }

    #[test]
    fn the_middle_column_lies_towards_minus_z_and_its_right_towards_plus_x() {
        let mut pixels = vec![[0.0_f32; 3]; 8 * 4];
        pixels[8 + 4] = [1.0, 0.0, 0.0];
        let panorama = EnvironmentMap::new(8, pixels, 0.0);
        // The pixel's centre is half a column right of the middle, half a row above the horizon.
        let (phi, theta) = (TAU / 16.0, 1.5 / 4.0 * PI);
        let direction = Vec3::new(
            theta.sin() * phi.sin(),
            theta.cos(),
            -theta.sin() * phi.cos(),
        );
        assert!((panorama.look(direction)[0] - 1.0).abs() < 1e-12);
    }
}
