//! What measurements suggest where nothing was measured: a weak pull of a network towards its nearest
//! measurements, everywhere above the surface.
//!
//! A network that meets measurements may do anything between and beyond them: a grid that stops at 60
//! degrees, or that is in one plane, leaves most of its domain open, and there a small strength of
//! regularisation lets it swing from black to its ceiling. Anchors are pairs of directions over the whole
//! hemisphere that take part in the fit as if something had been measured there, namely what the nearest
//! measurements say: nearest in half angle, difference angle and elevation, on which reflectance depends
//! most (F. Romeiro, Y. Vasilyev, T. Zickler, *Passive Reflectometry*, ECCV 2008). An anchor counts as
//! little as that guess is worth: about its variance, as leaving measurements out shows it, against that
//! of the fit, and less the farther away the nearest measurements are. Next to measurements it says
//! nothing that they do not say better.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use ndarray::{Array1, Array2, ArrayView2};
use rand::Rng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

use crate::streams::{self, generator};
use elm_datasets::geometry::{DirectionPair, NORMAL, cartesian, dot};

/// Anchors laid over the hemisphere, and further ones for light and viewer near the horizon, where
/// measurements end and a highlight's extrapolation grows fastest.
const ANCHORS: usize = 600;
const GRAZING: usize = 200;
/// Measurements that a guess is the mean of.
const NEAREST: usize = 6;
/// Measurements listed for each anchor, so that some are left when a fold is left out.
const LISTED: usize = 24;
/// Measurements left out to see what guesses are worth.
const VALIDATION: usize = 200;

/// Coordinates in which near means alike; the last two turn with a surface that has a `grain`.
fn place(pair: &DirectionPair, anisotropic: bool) -> [f64; 5] {
    let angles = pair.half_difference();
    let root = 2.0 * angles.theta_h().sqrt();
    let (x, y) = (
        pair.incident[0] + pair.outgoing[0],
        pair.incident[1] + pair.outgoing[1],
    );
    let turned = if anisotropic {
        root / (x * x + y * y).max(f64::MIN_POSITIVE)
    } else {
        0.0
    };
    [
        root,
        angles.theta_d(),
        0.5 * (pair.incident[2] + pair.outgoing[2]),
        turned * (x * x - y * y),
        turned * 2.0 * x * y,
    ]
}

/// A measurement, and its squared distance.
type Near = (f64, usize);

/// The measurements by their place.
pub(super) struct Neighborhood {
    places: Vec<[f64; 5]>,
    /// The same with their rows, the first coordinate rising.
    rising: Vec<([f64; 5], usize)>,
    anisotropic: bool,
}

impl Neighborhood {
    pub(super) fn new(pairs: &[DirectionPair], anisotropic: bool) -> Self {
        let places: Vec<_> = pairs.iter().map(|pair| place(pair, anisotropic)).collect();
        let mut rising: Vec<_> = places.iter().copied().zip(0..).collect();
        rising.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]));
        Self {
            places,
            rising,
            anisotropic,
        }
    }

    /// The nearest measurements but `without`, the nearest first, of equally near ones the first row.
    fn nearest(&self, at: [f64; 5], count: usize, without: Option<usize>) -> Vec<Near> {
        let mut near: Vec<Near> = Vec::with_capacity(count + 1);
        // From where the first coordinates agree both ways, up to where they alone differ by more than the
        // farthest place that is known.
        let middle = self.rising.partition_point(|(place, _)| place[0] < at[0]);
        let (before, after) = self.rising.split_at(middle);
        let mut below = before.iter().rev().peekable();
        let mut above = after.iter().peekable();
        let apart = |next: Option<&&([f64; 5], usize)>| {
            next.map_or(f64::INFINITY, |(place, _)| (place[0] - at[0]).powi(2))
        };
        loop {
            let (down, up) = (apart(below.peek()), apart(above.peek()));
            let next = if down <= up {
                below.next()
            } else {
                above.next()
            };
            let full = near.len() == count;
            let Some(&(place, row)) =
                next.filter(|_| !full || near.last().is_some_and(|last| down.min(up) <= last.0))
            else {
                return near;
            };
            let along = place.iter().zip(&at).map(|(a, b)| (a - b).powi(2));
            let found = (along.sum::<f64>(), row);
            if Some(row) == without || full && near.last().is_some_and(|last| found >= *last) {
                continue;
            }
            let after = near.partition_point(|known| *known <= found);
            near.insert(after, found);
            near.truncate(count);
        }
    }

    /// The guess for each of `pairs` of what `values`, shape (measurements, channels), are there.
    pub(super) fn guess(
        &self,
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
    ) -> Array2<f64> {
        let mut guesses = Array2::zeros((pairs.len(), values.ncols()));
        for (pair, guess) in pairs.iter().zip(guesses.rows_mut()) {
            let near = self.nearest(place(pair, self.anisotropic), NEAREST, None);
            mean_of(&near, values, guess);
        }
        guesses
    }
}

/// The mean of the values of `near`, weighted by the inverse of squared distance.
fn mean_of(near: &[Near], values: ArrayView2<'_, f64>, mut guess: ndarray::ArrayViewMut1<'_, f64>) {
    // A measurement in the very place must not drown the others beyond what a tenth of the way to
    // the farthest of them does: they are as noisy as it is.
    let floor = 1e-2 * near.last().map_or(0.0, |last| last.0) + f64::MIN_POSITIVE;
    let mut total = 0.0;
    for &(distance, row) in near {
        let weight = (floor / (distance + floor)).max(f64::MIN_POSITIVE);
        guess.scaled_add(weight, &values.row(row));
        total += weight;
    }
    if total > 0.0 {
        guess /= total;
    }
}

/// The anchors of a set of measurements.
pub(super) struct Anchors {
    /// Where they are.
    pub(super) pairs: Vec<DirectionPair>,
    near: Vec<Vec<Near>>,
    /// Squared distance between each of some measurements and its nearest others, with these.
    validation: Vec<(usize, Vec<Near>)>,
}

impl Anchors {
    pub(super) fn new(neighborhood: &Neighborhood, seed: u64) -> Self {
        let mut random = generator(seed, streams::ANCHORS);
        let pairs = scatter(&mut random, neighborhood.anisotropic);
        let near = pairs
            .iter()
            .map(|pair| place(pair, neighborhood.anisotropic));
        let near = near.map(|at| neighborhood.nearest(at, LISTED, None));
        let rows = neighborhood.places.len();
        let validation = index::sample(&mut random, rows, VALIDATION.min(rows));
        let validation = validation.into_iter().map(|row| {
            let at = neighborhood.places[row];
            (row, neighborhood.nearest(at, NEAREST, Some(row)))
        });
        Self {
            near: near.collect(),
            validation: validation.collect(),
            pairs,
        }
    }

    /// What measurements of which `is_there` say at each anchor, shape (anchors, channels).
    pub(super) fn targets(
        &self,
        targets: ArrayView2<'_, f64>,
        is_there: impl Fn(usize) -> bool,
    ) -> Array2<f64> {
        let mut guesses = Array2::zeros((self.pairs.len(), targets.ncols()));
        for (near, guess) in self.near.iter().zip(guesses.rows_mut()) {
            let there = near.iter().copied().filter(|&(_, row)| is_there(row));
            let there: Vec<Near> = there.take(NEAREST).collect();
            // All of them left out: better than nothing are those themselves.
            let there = if there.is_empty() { near } else { &there };
            mean_of(there, targets, guess);
        }
        guesses
    }

    /// How much each anchor counts as a row of the fit, of which the targets of each channel have the
    /// variance `variances` about the network.
    pub(super) fn weights(&self, targets: ArrayView2<'_, f64>, variances: &[f64]) -> Array1<f64> {
        let (mut squares, mut distances) = (0.0, 0.0);
        for (row, near) in &self.validation {
            let mut guess = Array1::zeros(targets.ncols());
            mean_of(near, targets, guess.view_mut());
            let errors = (&guess - &targets.row(*row)).into_iter();
            let relative = errors.zip(variances).map(|(e, v)| e * e / v.max(1e-300));
            squares += relative.sum::<f64>() / variances.len() as f64;
            distances += near.first().map_or(0.0, |nearest| nearest.0);
        }
        let count = self.validation.len().max(1) as f64;
        let (squares, usual) = ((squares / count).max(1.0), distances / count);
        let weight = |near: &Vec<Near>| {
            let distance = near.first().map_or(0.0, |nearest| nearest.0);
            let farther = if usual > 0.0 {
                (distance / usual).max(1.0)
            } else {
                1.0
            };
            1.0 / (squares * farther)
        };
        self.near.iter().map(weight).collect()
    }
}

/// Pairs of directions over the hemisphere: half of [`ANCHORS`] anywhere by both angles, half by the
/// half vector, near the mirror direction; and [`GRAZING`] ones in both of whose directions near the horizon.
/// For a surface with a grain each is turned about the normal.
pub(super) fn scatter(random: &mut ChaCha8Rng, anisotropic: bool) -> Vec<DirectionPair> {
    let mut pairs = Vec::with_capacity(ANCHORS + GRAZING);
    while pairs.len() < ANCHORS {
        if pairs.len() % 2 == 0 {
            let mut theta = || random.random_range(0.0..FRAC_PI_2);
            let (theta_i, theta_o) = (theta(), theta());
            pairs.push(DirectionPair {
                incident: cartesian(theta_i, 0.0),
                outgoing: cartesian(theta_o, random.random_range(0.0..PI)),
            });
            continue;
        }
        let part: f64 = random.random_range(0.0..1.0);
        let half = cartesian(FRAC_PI_2 * part * part, 0.0);
        let light = cartesian(
            random.random_range(0.0..FRAC_PI_2),
            random.random_range(0.0..TAU),
        );
        // The light turned from the normal to the half vector, then mirrored about that.
        let incident = about(half, light);
        let along = 2.0 * dot(incident, half);
        let outgoing = [0, 1, 2].map(|axis| along * half[axis] - incident[axis]);
        let pair = DirectionPair { incident, outgoing };
        // Half vectors that tilt far have few lights: the others stand for these too.
        pairs.push(if pair.is_above_horizon() {
            pair
        } else {
            let theta = random.random_range(0.0..FRAC_PI_2);
            DirectionPair {
                incident: cartesian(theta, 0.0),
                outgoing: cartesian(theta, PI * (1.0 - part * part)),
            }
        });
    }
    for _ in 0..GRAZING {
        let mut theta = || FRAC_PI_2 * (1.0 - 0.25 * random.random_range(0.0_f64..1.0).powi(2));
        let (theta_i, theta_o) = (theta(), theta());
        let part: f64 = random.random_range(0.0..1.0);
        pairs.push(DirectionPair {
            incident: cartesian(theta_i, 0.0),
            outgoing: cartesian(theta_o, PI * (1.0 - part * part)),
        });
    }
    if anisotropic {
        for pair in &mut pairs {
            *pair = pair.turned(random.random_range(0.0..TAU));
        }
    }
    pairs
}

/// A direction given about the normal, about `axis` (in the plane y = 0) instead.
fn about(axis: [f64; 3], direction: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = (axis[0], dot(axis, NORMAL));
    let [x, y, z] = direction;
    [cos * x + sin * z, y, cos * z - sin * x]
}

#[test]
fn the_nearest_are_those_of_all_measurements() {
    let pairs = scatter(&mut generator(7, streams::ANCHORS), true);
    for anisotropic in [false, true] {
        // Every place twice: of equally near ones the first row counts.
        let twice: Vec<DirectionPair> = pairs.iter().chain(&pairs).copied().collect();
        let neighborhood = Neighborhood::new(&twice, anisotropic);
        for (number, pair) in pairs.iter().enumerate().step_by(7) {
            let at = place(pair, anisotropic);
            let distance = |place: &[f64; 5]| -> f64 {
                let along = place.iter().zip(&at).map(|(a, b)| (a - b).powi(2));
                along.sum()
            };
            let places = neighborhood.places.iter().enumerate();
            let mut all: Vec<Near> = places.map(|(row, at)| (distance(at), row)).collect();
            all.sort_by(|a, b| a.partial_cmp(b).unwrap());
            assert_eq!(neighborhood.nearest(at, 9, None), all[..9]);
            let without = neighborhood.nearest(at, 9, Some(number));
            all.retain(|(_, row)| *row != number);
            assert_eq!(without, all[..9]);
            assert_eq!(neighborhood.nearest(at, 5000, None).len(), twice.len());
        }
    }
}
