//! Draws error against condition number, for every solver.

use std::error::Error;
use std::ops::Range;

use elm::Scalar;
use elm::solve::{LeastSquares, PseudoInverse, Solver};
use elm_brdf::report::plot;
use faer::prelude::Solve;
use faer::{Mat, Side};
use ndarray::Array2;
use plotters::prelude::*;

use super::cases::{Problem, conditioned};
use super::run::{distance, reference_of};
use crate::timing::median;

/// Errors of one way of solving, by condition number.
#[derive(Debug, Clone)]
pub struct Curve {
    /// The way.
    pub name: &'static str,
    /// Condition number, and the error of the test predictions against the double-double
    /// reference, relative to their norm; missing where the way gives no answer or, the
    /// pseudo-inverse beyond its cut-off, one that is not the least-squares answer.
    pub points: Vec<(f64, f64)>,
}

type Way = fn(&Problem) -> Option<f64>;

/// Errors at condition 1 to 1e16, median of this many seeds.
#[must_use]
pub fn curves(seeds: u64) -> Vec<Curve> {
    let ways: [(&str, Way); 5] = [
        ("normal equations, f64", normal_equations),
        ("pseudo-inverse, f32", |p| {
            error::<f32>(p, PseudoInverse::default().into())
        }),
        ("auto, f32", |p| error::<f32>(p, Solver::default())),
        ("pseudo-inverse, f64", |p| {
            error::<f64>(p, PseudoInverse::default().into())
        }),
        ("auto, f64", |p| error::<f64>(p, Solver::default())),
    ];
    let points = |way: Way| {
        let at = |power: i32| {
            let condition = 10.0_f64.powi(power);
            let errors: Vec<f64> = (1..=seeds)
                .filter_map(|seed| way(&conditioned(condition, seed)))
                .collect();
            // A median of the seeds that happen to work would flatter.
            let complete = errors.len() as u64 == seeds;
            Some((condition, median(errors).filter(|_| complete)?))
        };
        (0..=16).filter_map(at).collect()
    };
    ways.map(|(name, way)| Curve {
        name,
        points: points(way),
    })
    .to_vec()
}

fn error<A: Scalar>(problem: &Problem, solver: Solver) -> Option<f64> {
    let typed = |a: &Array2<f64>| a.mapv(A::from_f64);
    let exact = |a: &Array2<A>| a.mapv(A::as_f64);
    let (hidden, targets, test) = (
        typed(&problem.train),
        typed(&problem.targets),
        typed(&problem.test),
    );
    let solution = solver
        .solve(&LeastSquares::new(&hidden, &targets).ok()?)
        .ok()?;
    let truth = reference_of(
        &solution.diagnosis,
        exact(&hidden).view(),
        exact(&targets).view(),
        exact(&test).view(),
        false,
    )?;
    Some(distance(&exact(&test.dot(&solution.beta)), &truth))
}

/// Cholesky of $H^T H$, as other libraries do it.
fn normal_equations(problem: &Problem) -> Option<f64> {
    let (h, t) = (&problem.train, &problem.targets);
    let to_faer = |a: Array2<f64>| Mat::from_fn(a.nrows(), a.ncols(), |i, j| a[[i, j]]);
    let factor = to_faer(h.t().dot(h)).llt(Side::Lower).ok()?;
    let beta = factor.solve(to_faer(h.t().dot(t)));
    let beta = Array2::from_shape_fn((beta.nrows(), beta.ncols()), |(i, j)| beta[(i, j)]);
    let test = problem.test.view();
    let truth = super::reference::predict(h.view(), t.view(), test, &[0.0], false)?;
    Some(distance(&test.dot(&beta), &truth)).filter(|error| error.is_finite())
}

const CONDITIONS: Range<f64> = 1.0..1e16;
const ERRORS: Range<f64> = 1e-17..1e1;
/// Distinct for most colour-blind readers (Okabe and Ito, 2008).
const COLORS: [RGBColor; 5] = [
    RGBColor(213, 94, 0),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// The curves as an SVG picture.
///
/// # Errors
/// What the drawing library reports.
pub fn svg(curves: &[Curve]) -> Result<String, Box<dyn Error>> {
    plot::font();
    let mut picture = String::new();
    {
        let area = SVGBackend::with_string(&mut picture, (840, 520)).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .margin_right(28)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(CONDITIONS.log_scale(), ERRORS.log_scale())?;
        let label = ("sans-serif", 14);
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(225, 225, 225))
            .x_desc("condition of the hidden-layer matrix (200 x 40)")
            .y_desc("relative error of the test predictions")
            .x_labels(9)
            .y_labels(10)
            .x_label_formatter(&|v| format!("{v:.0e}"))
            .y_label_formatter(&|v| format!("{v:.0e}"))
            .label_style(label)
            .draw()?;
        for (curve, color) in curves.iter().zip(COLORS) {
            // Below the picture lies only exactness.
            let points = curve.points.iter().map(|&(x, y)| (x, y.max(ERRORS.start)));
            chart
                .draw_series(LineSeries::new(points, color.stroke_width(2)))?
                .label(curve.name)
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 22, y)], color.stroke_width(2))
                });
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .label_font(label)
            .draw()?;
        area.present()?;
    }
    Ok(picture)
}
