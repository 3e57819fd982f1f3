//! Run time against error: what every model costs to fit, to evaluate and to keep, beside its
//! held-out error.
//!
//! An **evaluation** is one pair of directions with all channels of one material, in a batch, on
//! one thread, from directions to reflectance. Networks and NBRDF are timed by
//! [columns](crate::batch), all other models by [`Brdf::eval`](elm_datasets::Brdf::eval). The
//! models take turns, so that what else the machine does meets all of them, and each has the median
//! of its turns.
//!
//! A model is on the **front** where no other is both as exact and as fast, and better in one.

mod timing;

use std::time::Instant;

use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use crate::batch::Packed;
use crate::error::Result;
use crate::fit::Model;
use crate::metrics::{Metric, Metrics};
use crate::model::BrdfModel;
use crate::registry::Candidate;
use crate::statistics::median;
use elm_datasets::geometry::DirectionPair;

/// Measurements to fit to, and others of the same material that judge.
#[derive(Debug, Clone)]
pub struct TrainTestSplit {
    /// Directions that are fitted to.
    pub train: Vec<DirectionPair>,
    /// BRDF in 1/sr at those, shape (pairs, channels).
    pub train_values: Array2<f64>,
    /// Directions that judge.
    pub test: Vec<DirectionPair>,
    /// BRDF in 1/sr at those.
    pub test_values: Array2<f64>,
}

impl TrainTestSplit {
    /// Holds out the rows that `is_held_out` says.
    #[must_use]
    pub fn split(
        pairs: &[DirectionPair],
        values: ArrayView2<'_, f64>,
        is_held_out: impl Fn(usize) -> bool,
    ) -> Self {
        let (test, train): (Vec<usize>, Vec<usize>) =
            (0..pairs.len()).partition(|&row| is_held_out(row));
        let pick = |rows: &[usize]| rows.iter().map(|&row| pairs[row]).collect();
        Self {
            train: pick(&train),
            train_values: values.select(Axis(0), &train),
            test: pick(&test),
            test_values: values.select(Axis(0), &test),
        }
    }
}

/// What one model costs and what it is worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CostPoint {
    /// The model's name.
    pub model: String,
    /// Its held-out error: mean over problems.
    pub error: f64,
    /// Seconds to fit it to one material: median over problems. For a model from a file, to read it.
    pub fit_seconds: f64,
    /// Nanoseconds for one pair of directions, all channels.
    pub nanoseconds_per_evaluation: f64,
    /// Numbers that must be stored for all channels.
    pub floats: usize,
    /// Whether no other model is both as exact and as fast, and better in one.
    pub on_front: bool,
}

/// A model that was not fitted here, with the seconds that it took to read.
pub struct PretrainedModel {
    /// Its name.
    pub name: String,
    /// The model.
    pub model: Box<dyn Model>,
    /// Seconds to read it.
    pub seconds: f64,
}

/// Fits, judges and times every candidate, and what is given; `done` is told how many candidates
/// are fitted so far. Points are in order of time per evaluation.
///
/// # Errors
/// Those of the methods and models.
pub fn run(
    candidates: &[Candidate],
    given: Vec<PretrainedModel>,
    problems: &[TrainTestSplit],
    metric: Metric,
    mut done: impl FnMut(usize),
) -> Result<Vec<CostPoint>> {
    let mut points = Vec::new();
    let mut models: Vec<Box<dyn Model>> = Vec::new();
    for (index, candidate) in candidates.iter().enumerate() {
        let mut seconds = Vec::new();
        // By form, then by problem.
        let mut errors: Vec<(String, Vec<f64>)> = Vec::new();
        for (number, problem) in problems.iter().enumerate() {
            let start = Instant::now();
            let model = candidate
                .method
                .fit(&problem.train, problem.train_values.view())?;
            seconds.push(start.elapsed().as_secs_f64());
            for (place, (name, form)) in packed_variants(&candidate.name, model)?
                .into_iter()
                .enumerate()
            {
                let error = held_out_error(form.as_ref(), problem, metric)?;
                match errors.get_mut(place) {
                    Some((_, errors)) => errors.push(error),
                    None => errors.push((name, vec![error])),
                }
                if number == 0 {
                    models.push(form);
                }
            }
        }
        let fit_seconds = median(seconds).unwrap_or(0.0);
        points.extend(errors.into_iter().map(|(model, errors)| CostPoint {
            model,
            error: errors.iter().sum::<f64>() / errors.len() as f64,
            fit_seconds,
            nanoseconds_per_evaluation: 0.0,
            floats: 0,
            on_front: false,
        }));
        done(index + 1);
    }
    for PretrainedModel {
        name,
        model,
        seconds,
    } in given
    {
        let errors: Vec<f64> = problems
            .iter()
            .map(|problem| held_out_error(model.as_ref(), problem, metric))
            .collect::<Result<_>>()?;
        points.push(CostPoint {
            model: name,
            error: errors.iter().sum::<f64>() / errors.len() as f64,
            fit_seconds: seconds,
            nanoseconds_per_evaluation: 0.0,
            floats: 0,
            on_front: false,
        });
        models.push(model);
    }
    if let Some(problem) = problems.first() {
        let times = timing::take_turns(&models, &problem.test)?;
        for ((point, model), time) in points.iter_mut().zip(&models).zip(times) {
            point.nanoseconds_per_evaluation = time;
            point.floats = model.stored_floats();
        }
    }
    mark_front(&mut points);
    Ok(points)
}

/// A network in single and in double precision, packed; any other model as it is.
fn packed_variants(name: &str, model: Box<dyn Model>) -> Result<Vec<(String, Box<dyn Model>)>> {
    let Some(network) = BrdfModel::of(&*model) else {
        return Ok(vec![(name.to_owned(), model)]);
    };
    Ok(vec![
        (
            format!("{name}, f32"),
            Box::new(Packed::<f32>::new(network)?),
        ),
        (
            format!("{name}, f64"),
            Box::new(Packed::<f64>::new(network)?),
        ),
    ])
}

fn held_out_error(model: &dyn Model, problem: &TrainTestSplit, metric: Metric) -> Result<f64> {
    let predicted = model.eval(&problem.test)?;
    let metrics = Metrics::of(&problem.test, predicted.view(), problem.test_values.view())?;
    Ok(metric.of(&metrics))
}

/// Sorts points by time and says which are on the front.
fn mark_front(points: &mut [CostPoint]) {
    let time = |point: &CostPoint| point.nanoseconds_per_evaluation;
    points.sort_by(|a, b| {
        time(a)
            .total_cmp(&time(b))
            .then(a.error.total_cmp(&b.error))
    });
    let mut least = f64::INFINITY;
    for point in points {
        point.on_front = point.error < least;
        least = least.min(point.error);
    }
}

/// The fastest model, other than `reference`, whose error is no larger than that one's, and its
/// share of that one's time.
#[must_use]
pub fn cheapest_as_exact<'a>(
    points: &'a [CostPoint],
    reference: &str,
) -> Option<(&'a CostPoint, f64)> {
    let reference = points.iter().find(|point| point.model == reference)?;
    let as_exact = points
        .iter()
        .filter(|point| point.error <= reference.error && point.model != reference.model);
    let time = |point: &CostPoint| point.nanoseconds_per_evaluation;
    let fastest = as_exact.min_by(|a, b| time(a).total_cmp(&time(b)))?;
    Some((fastest, time(fastest) / time(reference)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(model: &str, error: f64, nanoseconds: f64) -> CostPoint {
        CostPoint {
            model: model.to_owned(),
            error,
            fit_seconds: 0.0,
            nanoseconds_per_evaluation: nanoseconds,
            floats: 1,
            on_front: false,
        }
    }

    #[test]
    fn on_the_front_is_what_nothing_beats_in_both() {
        let mut points = vec![
            point("slow and exact", 0.1, 9.0),
            point("as slow, less exact", 0.2, 9.0),
            point("fast and coarse", 0.9, 1.0),
            point("slower, as coarse", 0.9, 2.0),
            point("between", 0.5, 3.0),
            point("beaten", 0.6, 4.0),
        ];
        mark_front(&mut points);
        let front: Vec<&str> = points
            .iter()
            .filter(|point| point.on_front)
            .map(|point| point.model.as_str())
            .collect();
        assert_eq!(front, ["fast and coarse", "between", "slow and exact"]);
        let (fastest, share) = cheapest_as_exact(&points, "beaten").unwrap();
        assert_eq!((fastest.model.as_str(), share), ("between", 0.75));
        assert!(cheapest_as_exact(&points, "slow and exact").is_none());
        assert!(cheapest_as_exact(&points, "nosuch").is_none());
    }

    #[test]
    fn a_split_puts_every_row_on_one_side() {
        let pairs: Vec<DirectionPair> = (0..10)
            .map(|k| DirectionPair {
                incident: [f64::from(k), 0.0, 1.0],
                outgoing: [0.0, 0.0, 1.0],
            })
            .collect();
        let values = Array2::from_shape_fn((10, 1), |(row, _)| row as f64);
        let problem = TrainTestSplit::split(&pairs, values.view(), |row| row % 5 == 2);
        assert_eq!(problem.test_values.column(0).to_vec(), [2.0, 7.0]);
        assert_eq!(problem.test[1].incident[0], 7.0);
        assert_eq!(problem.train.len(), 8);
        assert_eq!(problem.train_values[[2, 0]], 3.0);
    }
}
