//! Error by angle.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::{BLUE, Chart, Drawn, GRAY, GREEN, PALE, PredictionPlot, VERMILION, titled};
use elm_datasets::geometry::DirectionPair;

/// Width of a bin in degrees.
const WIDTH: f64 = 10.0;
const BINS: usize = 9;
/// Fewer errors than this have no mean worth a point.
const MIN: usize = 5;

const ANGLES: [(&str, RGBColor); 3] = [
    ("theta_i, of the light", BLUE),
    ("theta_o, of the viewer", GREEN),
    (
        "theta_h, of the half vector (0: mirror direction)",
        VERMILION,
    ),
];

pub(super) struct ByAngle {
    title: String,
    /// For each of [`ANGLES`] the middles of bins in degrees, and the RMSE there in 1/sr.
    curves: [Vec<(f64, f64)>; 3],
    /// Root mean square of the noise floors in 1/sr.
    noise_floor: Option<f64>,
}

fn angles(pair: &DirectionPair) -> [f64; 3] {
    let polar = |v: [f64; 3]| v[0].hypot(v[1]).atan2(v[2]);
    let half = pair.half_difference().theta_h();
    [polar(pair.incident), polar(pair.outgoing), half].map(f64::to_degrees)
}

impl ByAngle {
    pub(super) fn new(title: &str, materials: &[PredictionPlot<'_>]) -> Self {
        let mut sums = [[(0.0, 0_usize); BINS]; 3];
        for material in materials {
            let rows = material.measured.rows().into_iter();
            let rows = rows.zip(material.predicted.rows()).zip(&material.pairs);
            for ((measured, predicted), pair) in rows {
                for (sums, angle) in sums.iter_mut().zip(angles(pair)) {
                    let bin = ((angle / WIDTH) as usize).min(BINS - 1);
                    for (m, p) in measured.iter().zip(predicted) {
                        sums[bin].0 += (p - m).powi(2);
                        sums[bin].1 += 1;
                    }
                }
            }
        }
        let curve = |bins: [(f64, usize); BINS]| {
            let points = bins.into_iter().enumerate();
            points
                .filter(|(_, (sum, count))| *count >= MIN && sum.is_finite())
                .map(|(bin, (sum, count))| {
                    ((bin as f64 + 0.5) * WIDTH, (sum / count as f64).sqrt())
                })
                .collect()
        };
        let floors: Vec<f64> = materials.iter().filter_map(|m| m.noise_floor).collect();
        let squares: f64 = floors.iter().map(|floor| floor * floor).sum();
        Self {
            title: title.to_owned(),
            curves: sums.map(curve),
            noise_floor: (!floors.is_empty()).then(|| (squares / floors.len() as f64).sqrt()),
        }
    }
}

impl Chart for ByAngle {
    fn size(&self) -> (u32, u32) {
        (860, 620)
    }

    fn draw<DB: DrawingBackend>(&self, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
        let area = titled(area, "Error by angle, held out", &self.title)?;
        let values = self.curves.iter().flatten().map(|point| point.1);
        let most = values.chain(self.noise_floor).fold(0.0, f64::max);
        let most = if most > 0.0 { 1.15 * most } else { 1.0 };
        let mut chart = ChartBuilder::on(&area)
            .margin(16)
            .x_label_area_size(46)
            .y_label_area_size(76)
            .build_cartesian_2d(0.0..90.0, 0.0..most)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(PALE)
            .x_desc("angle from the normal (degrees)")
            .y_desc("root mean squared error (1/sr)")
            .x_labels(10)
            .x_label_formatter(&|angle| format!("{angle:.0}"))
            .label_style(("sans-serif", 13))
            .axis_desc_style(("sans-serif", 15))
            .draw()?;
        for (index, ((name, color), points)) in ANGLES.iter().zip(&self.curves).enumerate() {
            let color = *color;
            chart.draw_series(LineSeries::new(
                points.iter().copied(),
                color.stroke_width(2),
            ))?;
            // A shape for each, for whoever cannot tell the colours.
            let marks = points.iter();
            let label = move |(x, y): (i32, i32)| {
                PathElement::new([(x, y), (x + 24, y)], color.stroke_width(2))
            };
            match index {
                0 => {
                    chart.draw_series(marks.map(|&point| Circle::new(point, 5, color.filled())))?
                }
                1 => chart.draw_series(
                    marks.map(|&point| TriangleMarker::new(point, 7, color.filled())),
                )?,
                _ => chart
                    .draw_series(marks.map(|&point| Cross::new(point, 6, color.stroke_width(2))))?,
            }
            .label(format!(
                "{} {name}",
                ["\u{25cf}", "\u{25b2}", "\u{2715}"][index]
            ))
            .legend(label);
        }
        if let Some(floor) = self.noise_floor {
            let line = [(0.0, floor), (90.0, floor)];
            chart
                .draw_series(DashedLineSeries::new(line, 6, 5, GRAY.stroke_width(2)))?
                .label("noise floor from reciprocal pairs, root mean square")
                .legend(|(x, y)| PathElement::new([(x, y), (x + 24, y)], GRAY.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperMiddle)
            .background_style(WHITE.mix(0.85))
            .border_style(PALE)
            .label_font(("sans-serif", 13))
            .draw()
    }
}
