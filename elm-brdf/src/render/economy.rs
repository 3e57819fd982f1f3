//! A smaller network in place of a material's model, where its error cannot be seen.

use std::f64::consts::{FRAC_PI_2, PI};

use elm::solve::Ridge;
use elm::{Activation, ElmParams};
use ndarray::Array2;

use super::film::display_slope;
use super::vector::Rgb;
use crate::brdf::{Brdf, Fit};
use crate::error::Result;
use crate::features::Features;
use crate::geometry::{Pair, cartesian};
use crate::link::Link;
use crate::model::BrdfParams;

/// Neurons of the smaller network.
const NEURONS: usize = 32;
/// Steps in theta_o, in theta_i and in the azimuth between.
const STEPS: [usize; 3] = [16, 24, 16];
/// The horizon itself is no direction of a surface; the grid ends a little above.
const LAST_THETA: f64 = FRAC_PI_2 - 1e-3;
/// What the error within a cell may be, relative to the largest at its corners.
const MARGIN: f64 = 1.5;

/// A smaller network with its error in every cell of a grid over isotropic pairs of directions.
pub(crate) struct Economy {
    brdf: Box<dyn Brdf>,
    cells: Vec<Cell>,
}

/// By channel, in 1/sr: the largest error at the cell's corners with a margin, and the least value
/// there.
#[derive(Debug, Clone, Copy)]
struct Cell {
    error: Rgb,
    least: Rgb,
}

impl Economy {
    /// Fits a smaller network to `model` itself; `None` if it would not cost less than a quarter.
    pub(crate) fn new(model: &dyn Brdf) -> Result<Option<Self>> {
        let features = Features::ReciprocalCosines;
        let cost = NEURONS * (features.inputs().len() + model.channels());
        if model.multiply_adds() < 4 * cost {
            return Ok(None);
        }
        let corners = corners();
        let values = model
            .eval(&corners)?
            .mapv(|v| if v.is_finite() { v.max(0.0) } else { 0.0 });
        let small = BrdfParams {
            features,
            link: Link::default_log(),
            network: ElmParams::new(NEURONS)
                .activation(Activation::Tanh)
                .solver(Ridge::relative(1e-10)),
        };
        let brdf = small.fit(&corners, values.view())?;
        let cells = cells(&values, &brdf.eval(&corners)?);
        Ok(Some(Self { brdf, cells }))
    }

    /// Whether a value times `weight` times `gain` is off by no more than `steps` display steps.
    ///
    /// The display's curve is steepest where the light of this value is all there is; any more
    /// makes the error smaller.
    pub(crate) fn is_enough(&self, pair: &Pair, weight: Rgb, gain: f64, steps: f64) -> bool {
        let Cell { error, least } = self.cells[cell_of(pair)];
        (0..3).all(|channel| {
            let factor = weight[channel] * gain;
            let error = factor * error[channel];
            let least = (factor * least[channel] - error).max(0.0);
            255.0 * error * display_slope(least) <= steps
        })
    }

    pub(crate) fn brdf(&self) -> &dyn Brdf {
        &*self.brdf
    }
}

/// Index of a corner by its steps.
fn corner(steps: [usize; 3]) -> usize {
    (steps[0] * (STEPS[1] + 1) + steps[1]) * (STEPS[2] + 1) + steps[2]
}

fn corners() -> Vec<Pair> {
    let mut pairs = Vec::new();
    let part = |axis: usize, step: usize| step as f64 / STEPS[axis] as f64;
    for o in 0..=STEPS[0] {
        for i in 0..=STEPS[1] {
            for phi in 0..=STEPS[2] {
                pairs.push(Pair {
                    incident: cartesian(part(1, i) * LAST_THETA, part(2, phi) * PI),
                    outgoing: cartesian(part(0, o) * LAST_THETA, 0.0),
                });
            }
        }
    }
    pairs
}

fn cells(values: &Array2<f64>, small: &Array2<f64>) -> Vec<Cell> {
    let at = |array: &Array2<f64>, row: usize, channel: usize| {
        array[[row, channel.min(array.ncols() - 1)]]
    };
    let mut cells = Vec::with_capacity(STEPS.iter().product());
    for o in 0..STEPS[0] {
        for i in 0..STEPS[1] {
            for phi in 0..STEPS[2] {
                let mut cell = Cell {
                    error: [0.0; 3],
                    least: [f64::INFINITY; 3],
                };
                for c in 0..8 {
                    let row = corner([o + (c & 1), i + (c >> 1 & 1), phi + (c >> 2)]);
                    for channel in 0..3 {
                        let value = at(values, row, channel);
                        let error = MARGIN * (at(small, row, channel) - value).abs();
                        cell.error[channel] = cell.error[channel].max(error);
                        cell.least[channel] = cell.least[channel].min(value);
                    }
                }
                cells.push(cell);
            }
        }
    }
    cells
}

/// Index of the cell that a pair above the horizon lies in.
fn cell_of(pair: &Pair) -> usize {
    let (i, o) = (pair.incident, pair.outgoing);
    let between = (o[0] * i[1] - o[1] * i[0])
        .atan2(o[0] * i[0] + o[1] * i[1])
        .abs();
    let step = |axis: usize, part: f64| ((part * STEPS[axis] as f64) as usize).min(STEPS[axis] - 1);
    let theta = |cosine: f64| cosine.clamp(0.0, 1.0).acos() / LAST_THETA;
    (step(0, theta(o[2])) * STEPS[1] + step(1, theta(i[2]))) * STEPS[2] + step(2, between / PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use elm_datasets::{Invalid, MaterialId, synthetic};
    use rand::{Rng, SeedableRng};

    fn model(neurons: usize) -> Box<dyn Brdf> {
        let data = synthetic::measurements(1, &[MaterialId::new(7).unwrap()], Invalid::Clamp);
        let samples = data.samples(0).unwrap();
        let pairs = crate::geometry::pairs(&samples.directions);
        let fit = super::super::default_network(205, Some(neurons));
        fit.fit(&pairs, samples.values.view()).unwrap()
    }

    #[test]
    fn the_error_in_a_cell_stays_within_what_its_corners_say() {
        let model = model(256);
        let economy = Economy::new(&*model).unwrap().unwrap();
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let pairs: Vec<Pair> = (0..4000)
            .map(|_| Pair {
                incident: cartesian(random.random_range(0.0..1.56), random.random_range(-PI..PI)),
                outgoing: cartesian(random.random_range(0.0..1.56), 0.0),
            })
            .collect();
        let (full, small) = (
            model.eval(&pairs).unwrap(),
            economy.brdf().eval(&pairs).unwrap(),
        );
        let passed = (0..pairs.len()).filter(|&row| {
            let cell = economy.cells[cell_of(&pairs[row])];
            (0..3).any(|c| (full[[row, c]].max(0.0) - small[[row, c]]).abs() > cell.error[c])
        });
        // The bound is measured, not proven: where the error peaks inside a cell the margin may
        // not do. Once in a hundred keeps a picture's mean far within its own bound.
        let passed = passed.count();
        assert!(passed <= 40, "{passed} of 4000");
    }

    #[test]
    fn a_network_that_costs_little_is_not_replaced() {
        assert!(Economy::new(&*model(60)).unwrap().is_none());
    }
}
