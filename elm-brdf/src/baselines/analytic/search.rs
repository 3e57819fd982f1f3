//! Shape parameters by a grid of starts and Levenberg and Marquardt's method, weights eliminated.

use elm_datasets::lobes::Cosines;

use super::family::{Analytic, MAX_SHAPES, MAX_TERMS};
use super::nonnegative::{Normal, solve};

/// Starts that go down from the grid.
const STARTS: usize = 3;
/// Steps of each at most.
const STEPS: usize = 50;
/// For one-sided derivatives by place (0 to 1 across the bounds): the root of rounding.
const DIFFERENCE: f64 = 1e-8;

/// Shape parameters as places within their bounds, 0 to 1.
type Places = [f64; MAX_SHAPES];

/// What all channels share: the model, the directions, and the grid's terms.
pub(super) struct Problem<'a> {
    family: Analytic,
    angles: &'a [Cosines],
    grid: Vec<GridPoint>,
}

struct GridPoint {
    index: [usize; MAX_SHAPES],
    places: Places,
    terms: Vec<[f64; MAX_TERMS]>,
    gram: [[f64; MAX_TERMS]; MAX_TERMS],
}

/// A point of the search: places, weights there, and what they leave.
#[derive(Clone)]
struct Fit {
    places: Places,
    weights: [f64; MAX_TERMS],
    residual: Vec<f64>,
    error: f64,
}

impl<'a> Problem<'a> {
    pub(super) fn new(family: Analytic, angles: &'a [Cosines]) -> Self {
        let shapes = family.shapes();
        let count = shapes.iter().map(|shape| shape.steps).product();
        let mut problem = Self {
            family,
            angles,
            grid: Vec::new(),
        };
        for number in 0..count {
            let (mut rest, mut index, mut places) = (number, [0; MAX_SHAPES], [0.0; MAX_SHAPES]);
            for (i, shape) in shapes.iter().enumerate() {
                index[i] = rest % shape.steps;
                rest /= shape.steps;
                places[i] = index[i] as f64 / (shape.steps - 1) as f64;
            }
            // Two lobes exchanged are the same model.
            if family == Analytic::Lafortune2 && index[..2] >= index[2..] {
                continue;
            }
            let terms = problem.terms(&places);
            problem.grid.push(GridPoint {
                index,
                places,
                gram: gram(&terms),
                terms,
            });
        }
        problem
    }

    /// Shape parameters and weights of the smallest squared error that the starts lead to.
    pub(super) fn fit(&self, measured: &[f64]) -> ([f64; MAX_SHAPES], [f64; MAX_TERMS]) {
        let mut best: Option<Fit> = None;
        for start in self.starts(measured) {
            let found = self.descend(start, measured);
            if best.as_ref().is_none_or(|best| found.error < best.error) {
                best = Some(found);
            }
        }
        best.map_or(([0.0; MAX_SHAPES], [0.0; MAX_TERMS]), |best| {
            (self.shapes(&best.places), best.weights)
        })
    }

    fn shapes(&self, places: &Places) -> [f64; MAX_SHAPES] {
        let mut values = [0.0; MAX_SHAPES];
        for (i, shape) in self.family.shapes().iter().enumerate() {
            values[i] = shape.at(places[i]);
        }
        values
    }

    fn terms(&self, places: &Places) -> Vec<[f64; MAX_TERMS]> {
        let shapes = self.shapes(places);
        self.angles
            .iter()
            .map(|angles| self.family.basis(angles, &shapes))
            .collect()
    }

    /// The best grid points, no two of them neighbours.
    fn starts(&self, measured: &[f64]) -> Vec<Places> {
        let count = self.family.terms().len();
        let mut ranked: Vec<(f64, &GridPoint)> = self
            .grid
            .iter()
            .map(|point| {
                let normal = Normal {
                    gram: point.gram,
                    moments: moments(&point.terms, measured),
                };
                (normal.solve(count).1, point)
            })
            .collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut chosen: Vec<&GridPoint> = Vec::new();
        for (_, point) in ranked {
            let apart = |other: &&GridPoint| {
                point
                    .index
                    .iter()
                    .zip(&other.index)
                    .any(|(a, b)| a.abs_diff(*b) > 1)
            };
            if chosen.iter().all(apart) {
                chosen.push(point);
            }
            if chosen.len() == STARTS {
                break;
            }
        }
        chosen.into_iter().map(|point| point.places).collect()
    }

    /// The best weights at these places.
    fn project(&self, places: Places, measured: &[f64]) -> Fit {
        let terms = self.terms(&places);
        let normal = Normal {
            gram: gram(&terms),
            moments: moments(&terms, measured),
        };
        let (weights, _) = normal.solve(self.family.terms().len());
        let residual: Vec<f64> = terms
            .iter()
            .zip(measured)
            .map(|(term, y)| term.iter().zip(&weights).map(|(t, w)| t * w).sum::<f64>() - y)
            .collect();
        Fit {
            places,
            weights,
            error: residual.iter().map(|r| r * r).sum(),
            residual,
        }
    }

    fn descend(&self, start: Places, measured: &[f64]) -> Fit {
        let count = self.family.shapes().len();
        let mut now = self.project(start, measured);
        let total: f64 = measured.iter().map(|y| y * y).sum();
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            // Below this the residual is rounding.
            if count == 0 || now.error <= 1e-28 * total {
                break;
            }
            let slopes: Vec<Vec<f64>> = (0..count).map(|i| self.slope(&now, i, measured)).collect();
            let Some(next) = self.step(&now, &slopes, &mut damping, measured) else {
                break;
            };
            let gained = now.error - next.error;
            let finished = gained <= 1e-9 * now.error;
            now = next;
            if finished {
                break;
            }
        }
        now
    }

    /// The derivative of the residual, weights refitted, by one place.
    fn slope(&self, now: &Fit, i: usize, measured: &[f64]) -> Vec<f64> {
        let mut places = now.places;
        let inwards = if places[i] < 0.5 { 1.0 } else { -1.0 };
        places[i] += inwards * DIFFERENCE;
        let width = places[i] - now.places[i];
        let moved = self.project(places, measured);
        let pairs = moved.residual.iter().zip(&now.residual);
        pairs.map(|(moved, here)| (moved - here) / width).collect()
    }

    /// The next point, if any strength of damping gives a better one.
    fn step(
        &self,
        now: &Fit,
        slopes: &[Vec<f64>],
        damping: &mut f64,
        measured: &[f64],
    ) -> Option<Fit> {
        let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let count = slopes.len();
        let lengths: Vec<f64> = slopes.iter().map(|s| product(s, s).sqrt()).collect();
        let slope: Vec<f64> = slopes.iter().map(|s| product(s, &now.residual)).collect();
        // A place at its bound that would go beyond stays; one that changes nothing too.
        let fixed = |i: usize| {
            i >= count
                || lengths[i] == 0.0
                || (now.places[i] <= 0.0 && slope[i] > 0.0)
                || (now.places[i] >= 1.0 && slope[i] < 0.0)
        };
        if (0..count).all(fixed) {
            return None;
        }
        while *damping < 1e8 {
            // Scaled to a diagonal of 1 + damping (Marquardt's choice).
            let (mut a, mut b) = ([[0.0; MAX_SHAPES]; MAX_SHAPES], [0.0; MAX_SHAPES]);
            for i in 0..MAX_SHAPES {
                a[i][i] = 1.0;
                if fixed(i) {
                    continue;
                }
                b[i] = -slope[i] / lengths[i];
                for j in (0..count).filter(|&j| !fixed(j)) {
                    a[i][j] = product(&slopes[i], &slopes[j]) / (lengths[i] * lengths[j]);
                }
                a[i][i] += *damping;
            }
            if let Some(step) = solve(a, b) {
                let mut places = now.places;
                for i in (0..count).filter(|&i| !fixed(i)) {
                    places[i] = (places[i] + step[i] / lengths[i]).clamp(0.0, 1.0);
                }
                let next = self.project(places, measured);
                if next.error < now.error {
                    *damping = (*damping * 0.2).max(1e-12);
                    return Some(next);
                }
            }
            *damping *= 5.0;
        }
        None
    }
}

fn gram(terms: &[[f64; MAX_TERMS]]) -> [[f64; MAX_TERMS]; MAX_TERMS] {
    let mut gram = [[0.0; MAX_TERMS]; MAX_TERMS];
    for term in terms {
        for i in 0..MAX_TERMS {
            for j in 0..MAX_TERMS {
                gram[i][j] += term[i] * term[j];
            }
        }
    }
    gram
}

fn moments(terms: &[[f64; MAX_TERMS]], measured: &[f64]) -> [f64; MAX_TERMS] {
    let mut moments = [0.0; MAX_TERMS];
    for (term, y) in terms.iter().zip(measured) {
        for (moment, t) in moments.iter_mut().zip(term) {
            *moment += t * y;
        }
    }
    moments
}
