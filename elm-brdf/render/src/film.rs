//! Accumulates samples per pixel, and estimates which pixels need more of them.

use rayon::prelude::*;

use crate::tracer::Sample;
use crate::vector::{Rgb, add};

/// Sums of the samples of every pixel.
pub(crate) struct Film {
    width: usize,
    pixels: Vec<Pixel>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Pixel {
    sum: Rgb,
    /// Sums of squares and of products with the place in the pixel, for the error of the mean only.
    squares: [f32; 3],
    products: [[f32; 2]; 3],
    /// Sums of the places about the middle, x and y, and of their squares and product.
    sample_positions: [f32; 2],
    place_squares: [f32; 3],
    samples: u32,
    visibility_hash: u64,
    /// Whether its samples have different signatures.
    has_edge: bool,
    /// Whether its samples used randomness beyond their position in the pixel: a light point or a
    /// direction.
    is_stochastic: bool,
}

/// Standard errors that a pixel may still be off by when it stops.
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
        pixel.has_edge |= pixel.samples > 0 && pixel.visibility_hash != sample.visibility_hash;
        pixel.visibility_hash = sample.visibility_hash;
        pixel.is_stochastic |= sample.is_stochastic;
        pixel.samples += 1;
        add(&mut pixel.sum, sample.radiance);
        let [x, y] = sample.place.map(|place| place - 0.5);
        for (channel, value) in sample.radiance.into_iter().enumerate() {
            pixel.squares[channel] += (value * value) as f32;
            pixel.products[channel][0] += (x * value) as f32;
            pixel.products[channel][1] += (y * value) as f32;
        }
        pixel.sample_positions[0] += x as f32;
        pixel.sample_positions[1] += y as f32;
        pixel.place_squares[0] += (x * x) as f32;
        pixel.place_squares[1] += (x * y) as f32;
        pixel.place_squares[2] += (y * y) as f32;
    }

    /// Which pixels would visibly change with more samples, up to `total` each: those with an edge
    /// of a shape or a hard shadow in them or beside them, those whose error passes `steps`
    /// display steps, and those whose light is drawn by lot: a lamp seen through a gap may not
    /// have shown yet, so that no error can be told from a few samples.
    pub(crate) fn unfinished(&self, total: u32, gain: f64, steps: f64) -> Vec<bool> {
        let errors: Vec<f32> = self
            .pixels
            .par_iter()
            .map(|pixel| pixel.error(total, gain) as f32)
            .collect();
        let height = self.pixels.len() / self.width;
        let is_unfinished = |at: usize| {
            let (row, column) = (at / self.width, at % self.width);
            let own = &self.pixels[at];
            let rows = row.saturating_sub(1)..(row + 2).min(height);
            let mut near = rows.flat_map(|r| {
                (column.saturating_sub(1)..(column + 2).min(self.width))
                    .map(move |c| r * self.width + c)
            });
            own.samples < total
                && (own.is_stochastic
                    || near.any(|near| {
                        let pixel = &self.pixels[near];
                        // The neighbours' errors stand in for what few samples have not yet seen.
                        pixel.has_edge
                            || pixel.visibility_hash != own.visibility_hash
                            || f64::from(errors[near]) > steps
                    }))
        };
        (0..self.pixels.len())
            .into_par_iter()
            .map(is_unfinished)
            .collect()
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
    ///
    /// Radiance in a pixel is taken as a plane over the pixel plus a rest. What the plane adds to
    /// the mean is known from where the samples lie, but for those still to come, of which any 2^k
    /// in order are stratified in 2^k columns and in as many rows, as Sobol points are. The rest
    /// is taken as independent, so that the mean of n samples has 1/n of its variance.
    fn error(&self, total: u32, gain: f64) -> f64 {
        let (n, whole) = (f64::from(self.samples), f64::from(total));
        // A plane has three parameters.
        if self.samples < 4 {
            return f64::INFINITY;
        }
        let sample_positions = SamplePositions::new(n, self.sample_positions, self.place_squares);
        let strata = 2.0_f64.powi(total.trailing_zeros() as i32);
        (0..3)
            .map(|channel| {
                let mean = self.sum[channel] / n;
                let products = self.products[channel].map(f64::from);
                let spread = (f64::from(self.squares[channel]) - n * mean * mean).max(0.0);
                let plane = sample_positions.fit(mean, products);
                let rest = (spread - plane.spread).max(0.0) / (n - 3.0);
                // A place within a stratum has a variance of 1/12 of its width squared.
                let [u, v] = plane.slopes;
                let to_come = (u * u + v * v) / (12.0 * whole * strata * strata);
                let deviation = (rest * (1.0 / n - 1.0 / whole) + to_come).sqrt();
                let error = plane.offset.abs() + STANDARD_ERRORS * deviation;
                // The curve is steepest below.
                error * gain * display_slope((mean.abs() - error).max(0.0) * gain) * 255.0
            })
            .fold(0.0, f64::max)
    }
}

/// Where the samples of a pixel lie, about its middle.
struct SamplePositions {
    n: f64,
    mean: [f64; 2],
    /// Sums of squares and of the product about the mean, and their determinant.
    squares: [f64; 3],
    determinant: f64,
}

/// The plane through samples that errs least.
struct LinearFit {
    slopes: [f64; 2],
    /// By how much it is off at the samples' mean place from the pixel's middle.
    offset: f64,
    /// What it explains of the samples' sum of squares about their mean.
    spread: f64,
}

impl SamplePositions {
    fn new(n: f64, sums: [f32; 2], squares: [f32; 3]) -> Self {
        let mean @ [x, y] = sums.map(|sum| f64::from(sum) / n);
        let [xx, xy, yy] = squares.map(f64::from);
        let squares = [xx - n * x * x, xy - n * x * y, yy - n * y * y];
        let [xx, xy, yy] = squares;
        Self {
            n,
            mean,
            squares,
            determinant: xx * yy - xy * xy,
        }
    }

    /// Fits a plane to values, given their mean and the sums of their products with the places.
    fn fit(&self, mean: f64, products: [f64; 2]) -> LinearFit {
        let [xx, xy, yy] = self.squares;
        // Places on a line leave the plane open; then all is rest.
        if self.determinant < 1e-4 * xx * yy {
            return LinearFit {
                slopes: [0.0; 2],
                offset: 0.0,
                spread: 0.0,
            };
        }
        let [x, y] = self.mean;
        let [px, py] = [
            products[0] - self.n * mean * x,
            products[1] - self.n * mean * y,
        ];
        let slopes = [
            (px * yy - py * xy) / self.determinant,
            (py * xx - px * xy) / self.determinant,
        ];
        let [u, v] = slopes;
        LinearFit {
            slopes,
            offset: u * x + v * y,
            spread: u * px + v * py,
        }
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

    /// Four samples of each of 25 pixels, at the middles of the four quarters, from the pixel, the
    /// number of the sample and its place.
    fn film(values: impl Fn(u32, u32, [f64; 2]) -> (f64, u64)) -> Film {
        let mut film = Film::new(5, 5);
        for pixel in 0..25 {
            for n in 0..4 {
                // Stratified by quarters of both axes, as a (0, 2, 2)-net.
                let place = [
                    [0.145, 0.375],
                    [0.395, 0.875],
                    [0.645, 0.125],
                    [0.895, 0.625],
                ][n as usize];
                let (value, visibility_hash) = values(pixel, n, place);
                film.add(&Sample {
                    pixel,
                    place,
                    radiance: [value; 3],
                    visibility_hash,
                    is_stochastic: false,
                });
            }
        }
        film
    }

    #[test]
    fn an_even_picture_is_finished_and_a_complete_one_is_too() {
        assert!(
            !film(|_, _, _| (0.3, 1))
                .unfinished(16, 1.0, 0.5)
                .contains(&true)
        );
        assert!(
            !film(|p, n, _| (f64::from(p * n), n.into()))
                .unfinished(4, 1.0, 0.5)
                .contains(&true)
        );
    }

    #[test]
    fn an_edge_keeps_its_neighborhood_going() {
        let film = film(|pixel, n, _| (0.3, u64::from(pixel == 12 && n == 2)));
        let unfinished = film.unfinished(16, 1.0, 0.5);
        let expected = [6, 7, 8, 11, 12, 13, 16, 17, 18];
        assert!((0..25).all(|p| unfinished[p] == expected.contains(&p)));
    }

    #[test]
    fn noise_counts_in_display_steps() {
        // Along the direction that is neither constant nor linear over the four places, one degree
        // of freedom is left; a deviation s there is an error of 3 s sqrt(1/4 - 1/16) in radiance.
        // At 0.2 the slope is about 1.12, so that s = 0.001 is 0.37 steps and s = 0.003 over one.
        let rest = [1.0, -1.0, -1.0, 1.0];
        let noisy = |s: f64| film(move |_, n, _| (0.2 + s * 0.5 * rest[n as usize], 1));
        assert!(!noisy(0.001).unfinished(16, 1.0, 0.5).contains(&true));
        assert!(!noisy(0.003).unfinished(16, 1.0, 0.5).contains(&false));
        // Brighter by three stops the first is over it too.
        assert!(noisy(0.001).unfinished(16, 4.0, 0.5).contains(&true));
    }

    #[test]
    fn a_slope_counts_by_how_far_the_samples_are_off_the_middle() {
        // The places' mean is 0.02 off to the right. 16 samples to come: 3 / sqrt(12 * 16) / 16 =
        // 0.0135 of the slope. At 0.2 a slope of b is 0.0335 * 1.12 * 255 b = 9.6 b steps.
        let slope = |b: f64| film(move |_, _, [x, _]| (0.2 + b * (x - 0.5), 1));
        assert!(!slope(0.045).unfinished(16, 1.0, 0.5).contains(&true));
        assert!(!slope(0.06).unfinished(16, 1.0, 0.5).contains(&false));
    }
}
