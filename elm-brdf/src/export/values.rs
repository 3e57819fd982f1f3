//! From a network's sums to red, green and blue.

use std::fmt::Write;
use std::mem::discriminant;

use super::dialect::Language;
use super::network::{Values, Wavelength};
use super::write::Writer;
use crate::target_transform::Channel;

impl Writer<'_> {
    /// From the sums to the value, by the transform's inverse.
    pub(super) fn close(&mut self) {
        match &self.network.values {
            Values::Direct(transforms) => self.direct(transforms),
            Values::Color(spectrum) => self.color(spectrum),
        }
        self.out.push_str("}\n");
    }

    fn direct(&mut self, transforms: &[Channel]) {
        let language = self.language;
        let value = |index: usize, transform: Channel| {
            let t = match language {
                Language::C => format!("t[{index}]"),
                _ => format!("t{index}"),
            };
            let bounded = |value: String, ceiling: f64| {
                // Of a channel that is black throughout nothing is left to compute.
                if ceiling as f32 > 0.0 {
                    format!("min(max({value}, 0.0), {})", number(ceiling))
                } else {
                    "0.0".to_owned()
                }
            };
            language.expression(&match transform {
                Channel::Identity => format!("max({t}, 0.0)"),
                Channel::Log { offset, ceiling } => {
                    bounded(format!("{} * (exp({t}) - 1.0)", number(offset)), ceiling)
                }
                Channel::CubeRoot { ceiling } => bounded(format!("{t} * {t} * {t}"), ceiling),
            })
        };
        for channel in 0..3 {
            let text = match (language, transforms.get(channel)) {
                (Language::C, Some(&transform)) => {
                    format!("rgb[{channel}] = {};", value(channel, transform))
                }
                (Language::C, None) => format!("rgb[{channel}] = rgb[0];"),
                (_, Some(&transform)) => {
                    let kind = language.number();
                    language.define(kind, &format!("v{channel}"), &value(channel, transform))
                }
                (_, None) => continue,
            };
            self.line(&text);
        }
        if language != Language::C {
            let three = language.three();
            self.line(&match transforms.len() {
                1 => format!("return {three}(v0, v0, v0);"),
                _ => format!("return {three}(v0, v1, v2);"),
            });
        }
    }

    /// A spectrum four wavelengths at a time, or in C one after another, and the sums of its colors.
    fn color(&mut self, spectrum: &[Wavelength]) {
        let alike = |a: &Wavelength, b: &Wavelength| {
            discriminant(&a.transform) == discriminant(&b.transform)
        };
        if self.language == Language::C {
            let mut first = 0;
            for part in spectrum.chunk_by(alike) {
                self.wavelengths(first, part);
                first += part.len();
            }
            self.line("for (int c = 0; c < 3; ++c) { rgb[c] = fmaxf(rgb[c], 0.0f); }");
            return;
        }
        let language = self.language;
        for channel in 0..3 {
            let zero = match language {
                Language::Wgsl => format!("var v{channel} = f32(0.0);"),
                _ => format!("float v{channel} = 0.0;"),
            };
            self.line(&zero);
        }
        let parts = spectrum.chunk_by(alike).flat_map(|part| part.chunks(4));
        for (count, part) in parts.enumerate() {
            self.four_wavelengths(count, part);
        }
        let three = language.three();
        self.line(&format!(
            "return {three}(max(v0, 0.0), max(v1, 0.0), max(v2, 0.0));"
        ));
    }

    fn four_wavelengths(&mut self, count: usize, part: &[Wavelength]) {
        let (language, kind) = (self.language, self.language.four());
        // Missing wavelengths of the last four have no color.
        let four = |value: &dyn Fn(&Wavelength) -> f64| {
            let parts = (0..4).map(|n| language.literal(part.get(n).map_or(0.0, value)));
            format!("{kind}({})", parts.collect::<Vec<_>>().join(", "))
        };
        let mut terms = vec![four(&|w| w.mean)];
        for axis in 0..part[0].axes.len() {
            terms.push(format!("{} * t{axis}", four(&|w| w.axes[axis])));
        }
        let target = format!("w{count}");
        self.line(&language.define(kind, &target, &terms.join(" + ")));
        let (zero, most) = (four(&|_| 0.0), four(&|w| range(w.transform).1));
        let value = match part[0].transform {
            Channel::Identity => format!("max({target}, {zero})"),
            Channel::Log { .. } => {
                let offset = four(&|w| range(w.transform).0);
                format!("min(max({offset} * (exp({target}) - 1.0), {zero}), {most})")
            }
            Channel::CubeRoot { .. } => {
                format!("min(max({target} * {target} * {target}, {zero}), {most})")
            }
        };
        self.line(&language.define(kind, &format!("f{count}"), &value));
        for channel in 0..3 {
            let color = four(&|w| w.color[channel]);
            self.line(&format!(
                "v{channel} = v{channel} + dot({color}, f{count});"
            ));
        }
    }

    /// Rows of the table from `first` on, for C.
    fn wavelengths(&mut self, first: usize, part: &[Wavelength]) {
        let axes = part[0].axes.len();
        let value = match part[0].transform {
            Channel::Identity => "fmaxf(w, 0.0f)".to_owned(),
            Channel::Log { .. } => format!(
                "fminf(fmaxf(s[{}] * (expf(w) - 1.0f), 0.0f), s[{}])",
                axes + 1,
                axes + 2
            ),
            Channel::CubeRoot { .. } => {
                format!("fminf(fmaxf(w * w * w, 0.0f), s[{}])", axes + 2)
            }
        };
        for text in [
            format!("for (int k = {first}; k < {}; ++k) {{", first + part.len()),
            format!("    const float *s = {}_spectrum[k];", self.name),
            "    float w = s[0];".to_owned(),
            format!("    for (int c = 0; c < {axes}; ++c) {{ w += s[1 + c] * t[c]; }}"),
            format!("    const float f = {value};"),
            format!(
                "    for (int c = 0; c < 3; ++c) {{ rgb[c] += s[{} + c] * f; }}",
                axes + 3
            ),
            "}".to_owned(),
        ] {
            self.line(&text);
        }
    }

    /// The spectrum as a table, for C.
    pub(super) fn spectrum_table(&mut self) {
        let Values::Color(spectrum) = &self.network.values else {
            return;
        };
        let row = |w: &Wavelength| {
            let (offset, ceiling) = range(w.transform);
            let numbers = std::iter::once(w.mean).chain(w.axes.iter().copied());
            let numbers = numbers.chain([offset, ceiling]).chain(w.color);
            let numbers: Vec<String> = numbers.map(|v| Language::C.literal(v)).collect();
            format!("    {{{}}},\n", numbers.join(", "))
        };
        let axes = spectrum.first().map_or(0, |w| w.axes.len());
        let rows: String = spectrum.iter().map(row).collect();
        // Writing to a string cannot fail.
        let _ = write!(
            self.out,
            "/* By wavelength: target, what each output adds to it, offset, largest value, red, green, blue. */\n\
             static const float {}_spectrum[{}][{}] = {{\n{rows}}};\n\n",
            self.name,
            spectrum.len(),
            axes + 6,
        );
    }
}

/// Offset and ceiling of a transform, 0 where it has none.
fn range(transform: Channel) -> (f64, f64) {
    let bounded = |value: f64| value.min(f64::from(f32::MAX));
    match transform {
        Channel::Identity => (0.0, 0.0),
        Channel::Log { offset, ceiling } => (bounded(offset), bounded(ceiling)),
        Channel::CubeRoot { ceiling } => (0.0, bounded(ceiling)),
    }
}

fn number(value: f64) -> String {
    format!("{:?}", (value as f32).min(f32::MAX))
}
