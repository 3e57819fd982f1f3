//! Predicted against measured.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::{BLUE, Chart, Drawn, PALE, PredictionPlot, VERMILION, titled};

/// More points than this are thinned out, evenly: a picture does not gain by more.
const MAX_POINTS: usize = 15_000;
/// The axes span no more than this factor.
const MAX_SPAN: f64 = 1e7;

pub(super) struct Scatter {
    title: String,
    /// Measured and predicted, within the axes.
    points: Vec<(f64, f64)>,
    /// Both axes.
    range: (f64, f64),
    /// How many points lie below the axes.
    below: usize,
}

impl Scatter {
    pub(super) fn new(title: &str, materials: &[PredictionPlot<'_>]) -> Self {
        let all: Vec<(f64, f64)> = materials
            .iter()
            .flat_map(|m| m.measured.iter().copied().zip(m.predicted.iter().copied()))
            .filter(|(measured, predicted)| measured.is_finite() && predicted.is_finite())
            .collect();
        let positive = || all.iter().map(|p| p.0).filter(|&value| value > 0.0);
        let most = all.iter().fold(0.0, |most: f64, p| most.max(p.0).max(p.1));
        let most = if most > 0.0 { most } else { 1.0 };
        let least = positive().fold(most, f64::min);
        let range = (least.max(most / MAX_SPAN) / 1.5, most * 1.5);
        let step = all.len().div_ceil(MAX_POINTS).max(1);
        let inside = |value: f64| value.max(range.0);
        Self {
            title: title.to_owned(),
            below: all.iter().filter(|p| p.0.min(p.1) < range.0).count(),
            points: all
                .into_iter()
                .step_by(step)
                .map(|(measured, predicted)| (inside(measured), inside(predicted)))
                .collect(),
            range,
        }
    }
}

impl Chart for Scatter {
    fn size(&self) -> (u32, u32) {
        (760, 800)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
        let area = titled(area, "Predicted against measured, held out", &self.title)?;
        let (low, high) = self.range;
        let mut chart = ChartBuilder::on(&area)
            .margin(16)
            .x_label_area_size(46)
            .y_label_area_size(64)
            .build_cartesian_2d((low..high).log_scale(), (low..high).log_scale())?;
        let number = |value: &f64| {
            if *value < 1e-3 {
                format!("{value:.0e}")
            } else {
                format!("{value}")
            }
        };
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(PALE)
            .x_desc("measured BRDF (1/sr)")
            .y_desc("predicted BRDF (1/sr)")
            .x_label_formatter(&number)
            .y_label_formatter(&number)
            .label_style(("sans-serif", 13))
            .axis_desc_style(("sans-serif", 15))
            .draw()?;
        let label = match self.below {
            0 => "a held-out measurement".to_owned(),
            below => {
                format!("a held-out measurement ({below} below the axes, drawn on their ends)")
            }
        };
        // Few points are drawn solid, many as a cloud.
        let alpha = (300.0 / self.points.len().max(1) as f64).clamp(0.25, 0.7);
        let dots = self.points.iter();
        chart
            .draw_series(dots.map(|&point| Circle::new(point, 2, BLUE.mix(alpha).filled())))?
            .label(label)
            .legend(|(x, y)| Circle::new((x + 12, y), 3, BLUE.filled()));
        chart
            .draw_series(LineSeries::new(
                [(low, low), (high, high)],
                BLACK.stroke_width(1),
            ))?
            .label("predicted = measured")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 24, y)], BLACK));
        for (index, factor) in [0.5, 2.0].into_iter().enumerate() {
            let line = if factor < 1.0 {
                [(low / factor, low), (high, high * factor)]
            } else {
                [(low, low * factor), (high / factor, high)]
            };
            let series = chart.draw_series(DashedLineSeries::new(line, 6, 5, VERMILION.into()))?;
            if index == 0 {
                series
                    .label("off by a factor of 2")
                    .legend(|(x, y)| PathElement::new([(x, y), (x + 24, y)], VERMILION));
            }
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(PALE)
            .label_font(("sans-serif", 13))
            .draw()
    }
}
