//! The picture while it is made: sums of samples, and which pixels need more of them.

use super::tracer::Sample;
use super::vector::{Rgb, add};

/// Sums of the samples of every pixel.
pub(crate) struct Film {
    width: usize,
    pixels: Vec<Pixel>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Pixel {
    sum: Rgb,
    /// Sums of squares, for the error of the mean only.
    squares: [f32; 3],
    samples: u32,
    signature: u64,
    /// Whether its samples have different signatures.
    mixed: bool,
}

/// Standard errors that a pixel may still be off by when it stops. Sobol points err less than the
/// independent ones that the error is computed for.
const STANDARD_ERRORS: f64 = 3.0;

impl Film {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self {
            width: width as usize,
            pixels: vec![Pixel::default(); width as usize * height as usize],
        }
    }

    pub(crate) fn add(&mut self, sample: &Sample) {
        let pixel = &mut self.pixels[sample.pixel as usize];
        pixel.mixed |= pixel.samples > 0 && pixel.signature != sample.signature;
        pixel.signature = sample.signature;
        pixel.samples += 1;
        add(&mut pixel.sum, sample.radiance);
        for (sum, value) in pixel.squares.iter_mut().zip(sample.radiance) {
            *sum += (value * value) as f32;
        }
    }

    /// Which pixels would visibly change with more samples, up to `total` each: those with an edge
    /// of a shape or a hard shadow in them or beside them, and those whose error passes `steps`
    /// display steps.
    pub(crate) fn unfinished(&self, total: u32, gain: f64, steps: f64) -> Vec<bool> {
        let errors: Vec<f32> = self
            .pixels
            .iter()
            .map(|pixel| pixel.error(total, gain) as f32)
            .collect();
        let height = self.pixels.len() / self.width;
        let mut unfinished = vec![false; self.pixels.len()];
        for row in 0..height {
            for column in 0..self.width {
                let at = row * self.width + column;
                let own = &self.pixels[at];
                if own.samples >= total {
                    continue;
                }
                let rows = row.saturating_sub(1)..(row + 2).min(height);
                let edge_or_noise = rows.flat_map(|r| {
                    (column.saturating_sub(1)..(column + 2).min(self.width))
                        .map(move |c| r * self.width + c)
                });
                unfinished[at] = edge_or_noise.into_iter().any(|near| {
                    let pixel = &self.pixels[near];
                    // The neighbours' errors stand in for what few samples have not yet seen.
                    pixel.mixed
                        || pixel.signature != own.signature
                        || f64::from(errors[near]) > steps
                });
            }
        }
        unfinished
    }

    /// Samples taken of a pixel.
    pub(crate) fn samples(&self, pixel: usize) -> u32 {
        self.pixels[pixel].samples
    }

    /// Mean radiance of every pixel, row by row.
    pub(crate) fn picture(&self) -> Vec<Rgb> {
        self.pixels
            .iter()
            .map(|pixel| pixel.sum.map(|sum| sum / f64::from(pixel.samples.max(1))))
            .collect()
    }
}

impl Pixel {
    /// By how many display steps the mean may change on the way to `total` samples.
    fn error(&self, total: u32, gain: f64) -> f64 {
        let (n, total) = (f64::from(self.samples), f64::from(total));
        if self.samples < 2 {
            return f64::INFINITY;
        }
        (0..3)
            .map(|channel| {
                let mean = self.sum[channel] / n;
                let square = f64::from(self.squares[channel]) / n;
                let variance = (square - mean * mean).max(0.0) * n / (n - 1.0);
                let error = STANDARD_ERRORS * (variance * (1.0 / n - 1.0 / total)).sqrt();
                // The curve is steepest below.
                error * gain * display_slope((mean - error).max(0.0) * gain) * 255.0
            })
            .fold(0.0, f64::max)
    }
}

/// Slope of sRGB's curve, 0 where it is cut off.
pub(crate) fn display_slope(linear: f64) -> f64 {
    if linear >= 1.0 {
        0.0
    } else if linear <= 0.003_130_8 {
        12.92
    } else {
        1.055 / 2.4 * linear.powf(1.0 / 2.4 - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(values: impl Fn(u32, u32) -> (f64, u64)) -> Film {
        let mut film = Film::new(5, 5);
        for pixel in 0..25 {
            for n in 0..4 {
                let (value, signature) = values(pixel, n);
                let radiance = [value; 3];
                film.add(&Sample {
                    pixel,
                    radiance,
                    signature,
                });
            }
        }
        film
    }

    #[test]
    fn an_even_picture_is_finished_and_a_complete_one_is_too() {
        assert!(
            !film(|_, _| (0.3, 1))
                .unfinished(16, 1.0, 0.5)
                .contains(&true)
        );
        assert!(
            !film(|p, n| (f64::from(p * n), n.into()))
                .unfinished(4, 1.0, 0.5)
                .contains(&true)
        );
    }

    #[test]
    fn an_edge_keeps_its_neighbourhood_going() {
        let film = film(|pixel, n| (0.3, u64::from(pixel == 12 && n == 2)));
        let unfinished = film.unfinished(16, 1.0, 0.5);
        let expected = [6, 7, 8, 11, 12, 13, 16, 17, 18];
        assert!((0..25).all(|p| unfinished[p] == expected.contains(&p)));
    }

    #[test]
    fn noise_counts_in_display_steps() {
        // Standard deviation s of the samples: an error of 3 s sqrt(1/4 - 1/16) in radiance. At
        // 0.2 the slope is about 1.12, so that s = 0.001 is 0.37 steps and s = 0.003 over one.
        let noisy = |s: f64| film(move |_, n| (0.2 + s * [-1.0, 1.0][n as usize % 2], 1));
        assert!(!noisy(0.001).unfinished(16, 1.0, 0.5).contains(&true));
        assert!(!noisy(0.003).unfinished(16, 1.0, 0.5).contains(&false));
        // Brighter by three stops the first is over it too.
        assert!(noisy(0.001).unfinished(16, 4.0, 0.5).contains(&true));
    }
}
