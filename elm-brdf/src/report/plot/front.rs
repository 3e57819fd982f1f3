//! Error over time per evaluation, with the front.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::{BLUE, Chart, Drawn, GRAY, ORANGE, PALE, VERMILION, titled};
use crate::pareto::CostPoint;

pub(super) struct Front {
    title: String,
    error: String,
    /// Time, error, and what kind of model it is.
    points: Vec<(f64, f64, Kind)>,
    /// Time, error and name, by time.
    front: Vec<(f64, f64, String)>,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Network,
    Published,
    Other,
}

impl Kind {
    fn of(model: &str) -> Self {
        if model.starts_with("elm") {
            Self::Network
        } else if model.starts_with("nbrdf") {
            Self::Published
        } else {
            Self::Other
        }
    }

    fn color(self) -> RGBColor {
        match self {
            Self::Network => BLUE,
            Self::Published => VERMILION,
            Self::Other => ORANGE,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Network => "extreme learning machines",
            Self::Published => "NBRDF's published weights",
            Self::Other => "analytic models and interpolators",
        }
    }
}

impl Front {
    pub(super) fn new(title: &str, error: &str, points: &[CostPoint]) -> Self {
        // A logarithmic axis has no place for 0.
        let place = |point: &CostPoint| {
            let (time, error) = (point.nanoseconds_per_evaluation, point.error);
            (time > 0.0 && error > 0.0 && time.is_finite() && error.is_finite())
                .then_some((time, error))
        };
        Self {
            title: title.to_owned(),
            error: error.to_owned(),
            points: points
                .iter()
                .filter_map(|point| {
                    let (time, error) = place(point)?;
                    Some((time, error, Kind::of(&point.model)))
                })
                .collect(),
            front: points
                .iter()
                .filter(|point| point.on_front)
                .filter_map(|point| {
                    let (time, error) = place(point)?;
                    Some((time, error, point.model.clone()))
                })
                .collect(),
        }
    }

    /// An axis that leaves a margin around these values.
    fn axis(values: impl Iterator<Item = f64>) -> (f64, f64) {
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        if low <= high {
            (low / 1.4, high * 1.4)
        } else {
            (0.1, 1.0)
        }
    }

    /// What the front leaves possible: steps from the largest error to the largest time.
    fn steps(&self, most_time: f64, most_error: f64) -> Vec<(f64, f64)> {
        let mut steps = Vec::new();
        let mut before = most_error;
        for (time, error, _) in &self.front {
            steps.extend([(*time, before), (*time, *error)]);
            before = *error;
        }
        if !steps.is_empty() {
            steps.push((most_time, before));
        }
        steps
    }
}

/// Three digits, as few as that takes.
fn number(value: &f64) -> String {
    let places = (2.0 - value.log10().floor()).max(0.0) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

impl Chart for Front {
    fn size(&self) -> (u32, u32) {
        (1100, 680)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
        let area = titled(area, "Run time against held-out error", &self.title)?;
        let (area, names) = area.split_horizontally(790);
        let times = Self::axis(self.points.iter().map(|point| point.0));
        let errors = Self::axis(self.points.iter().map(|point| point.1));
        let mut chart = ChartBuilder::on(&area)
            .margin(16)
            .x_label_area_size(46)
            .y_label_area_size(72)
            .build_cartesian_2d(
                (times.0..times.1).log_scale(),
                (errors.0..errors.1).log_scale(),
            )?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(PALE)
            .x_desc("nanoseconds per evaluation, all channels")
            .y_desc(self.error.as_str())
            .x_label_formatter(&number)
            .y_label_formatter(&number)
            .label_style(("sans-serif", 13))
            .axis_desc_style(("sans-serif", 15))
            .draw()?;
        chart
            .draw_series(LineSeries::new(
                self.steps(times.1, errors.1),
                GRAY.stroke_width(2),
            ))?
            .label("Pareto front")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 24, y)], GRAY.stroke_width(2)));
        for kind in [Kind::Other, Kind::Network, Kind::Published] {
            let own = self.points.iter().filter(|point| point.2 == kind);
            let size = if kind == Kind::Published { 6 } else { 4 };
            let dots = own.map(|&(x, y, _)| {
                EmptyElement::at((x, y)) + Circle::new((0, 0), size, kind.color().mix(0.7).filled())
            });
            let series = chart.draw_series(dots)?;
            if self.points.iter().any(|point| point.2 == kind) {
                series
                    .label(kind.name())
                    .legend(move |(x, y)| Circle::new((x + 12, y), 4, kind.color().filled()));
            }
        }
        let small = ("sans-serif", 12).into_text_style(&area);
        chart.draw_series(self.front.iter().enumerate().map(|(index, (x, y, _))| {
            EmptyElement::at((*x, *y))
                + Circle::new((0, 0), 6, BLACK.stroke_width(1))
                + Text::new((index + 1).to_string(), (-6, 9), small.clone())
        }))?;
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.85))
            .border_style(PALE)
            .label_font(("sans-serif", 13))
            .draw()?;
        let heading = ("sans-serif", 14).into_text_style(&names);
        names.draw_text("On the front", &heading, (6, 16))?;
        for (index, (_, _, model)) in self.front.iter().take(32).enumerate() {
            let line = format!("{}  {model}", index + 1);
            names.draw_text(&line, &small, (6, 40 + 18 * index as i32))?;
        }
        Ok(())
    }
}
