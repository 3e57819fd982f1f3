//! The sampler of a material written out in a language: the [mixture](elm_datasets::mixture) of lobes that
//! the renderer draws directions from, in closed form. All its arithmetic is in single precision, arranged so
//! that narrow lobes keep their digits.

use std::fmt::Write;

use elm_datasets::mixture::{Lobe, LobeMixture};

use super::dialect::Language;

/// One over pi and over two pi.
const INVERSE_PI: &str = "0.318309886";
const INVERSE_TAU: &str = "0.159154943";

/// Source of `NAME_pdf` and `NAME_sample`.
pub(super) fn write(language: Language, name: &str, mixture: &LobeMixture, out: &mut String) {
    let mut writer = Writer {
        language,
        name,
        mixture,
        out,
        indent: 1,
    };
    writer.pdf();
    writer.sample();
}

struct Writer<'a> {
    language: Language,
    name: &'a str,
    mixture: &'a LobeMixture,
    out: &'a mut String,
    indent: usize,
}

impl Writer<'_> {
    /// Adds a line to a function's body.
    fn line(&mut self, text: &str) {
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(self.out, "{:width$}{text}", "", width = 4 * self.indent);
    }

    /// Defines a number that does not change, from common notation.
    fn number(&mut self, name: &str, expression: &str) {
        let language = self.language;
        let text = language.define(language.number(), name, expression);
        self.line(&text);
    }

    /// Defines a number that does.
    fn variable(&mut self, name: &str, expression: &str) {
        let expression = self.language.expression(expression);
        self.line(&match self.language {
            Language::Wgsl => format!("var {name} = f32({expression});"),
            _ => format!("float {name} = {expression};"),
        });
    }

    fn assign(&mut self, name: &str, expression: &str) {
        let expression = self.language.expression(expression);
        self.line(&format!("{name} = {expression};"));
    }

    /// The components of a direction that is an argument, those that lobes are made of.
    fn components(&mut self, letter: char, argument: &str) {
        let is_plain = |(lobe, _): &(Lobe, _)| matches!(lobe, Lobe::Cosine | Lobe::Uniform);
        let is_plain = self.mixture.lobes().iter().all(is_plain);
        for (index, axis) in ["x", "y", "z"].into_iter().enumerate() {
            if is_plain && axis != "z" {
                continue;
            }
            let component = match self.language {
                Language::C => format!("{argument}[{index}]"),
                _ => format!("{argument}.{axis}"),
            };
            self.number(&format!("{letter}{axis}"), &component);
        }
    }

    /// The lobes' shares `w0`, `w1`, ... for a viewer.
    fn shares(&mut self) {
        self.number("c", "min(max(oz, 0.0), 1.0)");
        self.number("d", "1.0 - c");
        let mixture = self.mixture;
        for (lobe, (_, weights)) in mixture.lobes().iter().enumerate() {
            let [a, b, e, f] = weights.map(decimal);
            let cubic =
                format!("d * d * (d * {a} + c * 3.0 * {b}) + c * c * (d * 3.0 * {e} + c * {f})");
            self.number(&format!("w{lobe}"), &cubic);
        }
    }

    fn pdf(&mut self) {
        let (language, name) = (self.language, format!("{}_pdf", self.name));
        let number = language.number();
        match language {
            Language::C => {
                let head = format!("float {name}(const float light[3], const float viewer[3])");
                let _ = writeln!(self.out, "\n{head};\n\n{head} {{");
            }
            _ => {
                let three = language.three();
                let arguments = [(three, "light"), (three, "viewer")];
                let head = language.head(number, &name, &arguments);
                let _ = writeln!(self.out, "\n{head}");
            }
        }
        self.components('i', "light");
        self.components('o', "viewer");
        let zero = language.expression("0.0");
        self.line(&format!(
            "if (!(iz > {zero} && oz > {zero})) {{ return {zero}; }}"
        ));
        self.shares();
        let mixture = self.mixture;
        for (index, (lobe, _)) in mixture.lobes().iter().enumerate() {
            self.density(index, *lobe);
        }
        let terms = (0..mixture.lobes().len()).map(|k| format!("w{k} * p{k}"));
        let sum = terms.collect::<Vec<_>>().join(" + ");
        self.line(&format!("return {sum};"));
        self.out.push_str("}\n");
    }

    /// Defines the density `p` of a lobe: [`Lobe::density`].
    fn density(&mut self, index: usize, lobe: Lobe) {
        let own = |text: &str| text.replace('#', &index.to_string());
        let mut lines: Vec<(&str, String)> = Vec::new();
        match lobe {
            Lobe::Cosine => lines.push(("p#", format!("iz * {INVERSE_PI}"))),
            Lobe::Tilted { factor } => {
                let f = decimal(factor);
                lines.push((
                    "m#",
                    format!("{} * (ox * ox + oy * oy)", decimal(factor * factor)),
                ));
                lines.push((
                    "r#",
                    format!(
                        "(1.0 - m#) / (1.0 + 2.0 * {f} * (ox * ix + oy * iy) + m# * (ix * ix + iy * iy))"
                    ),
                ));
                lines.push(("p#", format!("iz * {INVERSE_PI} * r# * r#")));
            }
            Lobe::Ggx { alpha, turn } => {
                let (sin, cos) = sin_cos(turn);
                let [along, across] = alpha.map(|alpha| decimal(1.0 / alpha));
                let [a, b] = alpha.map(decimal);
                // In the frame of the lobe; the sum of both directions, without its height and stretched.
                lines.push(("x#", format!("{cos} * ox + {sin} * oy")));
                lines.push(("y#", format!("{cos} * oy - {sin} * ox")));
                lines.push(("f#", format!("x# + {cos} * ix + {sin} * iy")));
                lines.push(("g#", format!("y# + {cos} * iy - {sin} * ix")));
                lines.push(("e#", "f# * f# + g# * g#".to_owned()));
                lines.push((
                    "s#",
                    format!("f# * f# * {along} * {along} + g# * g# * {across} * {across}"),
                ));
                lines.push(("h#", "oz + iz".to_owned()));
                lines.push(("l#", "max(oz - iz, 0.0)".to_owned()));
                lines.push(("u#", "(e# + h# * h#) / (s# + h# * h#)".to_owned()));
                // Nothing where the light below the horizon is as far down as the viewer is up.
                lines.push((
                    "b#",
                    "min(l# * 1e30, 1.0) * (e# + l# * l#) / max(s# + l# * l#, 1e-30)".to_owned(),
                ));
                let scale = decimal(0.5 / (std::f64::consts::PI * alpha[0] * alpha[1]));
                lines.push((
                    "p#",
                    format!(
                        "{scale} * (u# * u# + b# * b#) / (oz + sqrt({a} * {a} * x# * x# + {b} * {b} * y# * y# + oz * oz))"
                    ),
                ));
            }
            Lobe::Round { width, retro } => {
                let s = width * width / 2.0;
                let sign = if retro { '-' } else { '+' };
                lines.push(("x#", format!("ix {sign} ox")));
                lines.push(("y#", format!("iy {sign} oy")));
                lines.push(("e#", format!("{} + 0.5 * (x# * x# + y# * y#)", decimal(s))));
                lines.push(("u#", "e# + 0.5 * (iz - oz) * (iz - oz)".to_owned()));
                lines.push(("b#", "e# + 0.5 * (iz + oz) * (iz + oz)".to_owned()));
                let scale = decimal(s * (s + 2.0) / (4.0 * std::f64::consts::PI));
                lines.push((
                    "p#",
                    format!("{scale} * (1.0 / (u# * u#) + 1.0 / (b# * b#))"),
                ));
            }
            // `Uniform`; there are no others.
            _ => lines.push(("p#", INVERSE_TAU.to_owned())),
        }
        for (name, expression) in lines {
            self.number(&own(name), &own(&expression));
        }
    }

    fn sample(&mut self) {
        let (language, name) = (self.language, format!("{}_sample", self.name));
        match language {
            Language::C => {
                let head = format!(
                    "float {name}(const float viewer[3], const float u[2], float light[3])"
                );
                let _ = writeln!(self.out, "\n{head};\n\n{head} {{");
                self.line("light[0] = light[1] = 0.0f;");
                self.line("light[2] = 1.0f;");
                self.components('o', "viewer");
                self.line("if (!(oz > 0.0f)) { return 0.0f; }");
                self.number("u1", "u[0]");
                self.number("u2", "u[1]");
            }
            _ => {
                let (three, two) = (language.three(), language.two());
                let head = language.head(language.four(), &name, &[(three, "viewer"), (two, "u")]);
                let _ = writeln!(self.out, "\n{head}");
                self.components('o', "viewer");
                self.line(&format!(
                    "if (!(oz > 0.0)) {{ return {}(0.0, 0.0, 1.0, 0.0); }}",
                    language.four()
                ));
                self.number("u1", "u.x");
                self.number("u2", "u.y");
            }
        }
        self.shares();
        self.choose();
        for axis in ["x", "y", "z"] {
            self.variable(axis, "0.0");
        }
        // Twice pi times v less half a turn, which sines of shaders are most exact for.
        self.number("a", "6.28318531 * (v - 0.5)");
        self.number("ca", "-cos(a)");
        self.number("sa", "-sin(a)");
        let mixture = self.mixture;
        for (index, (lobe, _)) in mixture.lobes().iter().enumerate() {
            let condition = self.language.expression(&format!("{index}.5"));
            let before = if index == 0 { "" } else { "} else " };
            self.line(&if index + 1 == mixture.lobes().len() && index > 0 {
                "} else {".to_owned()
            } else {
                format!("{before}if (k < {condition}) {{")
            });
            self.indent += 1;
            self.draw(*lobe);
            self.indent -= 1;
        }
        self.line("}");
        // What is drawn below the horizon is reflected upwards.
        self.number("n", "1.0 / sqrt(max(x * x + y * y + z * z, 1e-30))");
        if language == Language::C {
            for (index, value) in ["x * n", "y * n", "abs(z) * n"].into_iter().enumerate() {
                self.assign(&format!("light[{index}]"), value);
            }
            self.line(&format!("return {}_pdf(light, viewer);", self.name));
        } else {
            let (three, four) = (language.three(), language.four());
            let light = format!("{three}(x * n, y * n, abs(z) * n)");
            let text = language.define(three, "light", &light);
            self.line(&text);
            self.line(&format!(
                "return {four}(light, {}_pdf(light, viewer));",
                self.name
            ));
        }
        self.out.push_str("}\n");
    }

    /// Defines `k`, the index of the lobe that the first number chooses, and `v`, where in that lobe's share
    /// the number lies.
    fn choose(&mut self) {
        self.variable("k", "0.0");
        self.variable("v", "u1 / max(w0, 1e-30)");
        self.variable("e", "w0");
        for index in 1..self.mixture.lobes().len() {
            let condition = self
                .language
                .expression(&format!("w{index} > 0.0 && u1 >= e"));
            self.line(&format!("if ({condition}) {{"));
            self.indent += 1;
            self.assign("k", &format!("{index}.0"));
            self.assign("v", &format!("(u1 - e) / w{index}"));
            self.indent -= 1;
            self.line("}");
            if index + 1 < self.mixture.lobes().len() {
                self.assign("e", &format!("e + w{index}"));
            }
        }
        self.assign("v", "min(max(v, 0.0), 0.99999994)");
    }

    /// Assigns a direction of the lobe to `x`, `y` and `z`: [`Lobe::sample`].
    fn draw(&mut self, lobe: Lobe) {
        match lobe {
            Lobe::Cosine => {
                self.number("r", "sqrt(u2)");
                self.assign("x", "r * ca");
                self.assign("y", "r * sa");
                self.assign("z", "sqrt(max(1.0 - u2, 0.0))");
            }
            Lobe::Tilted { factor } => self.draw_tilted(factor),
            Lobe::Ggx { alpha, turn } => self.draw_ggx(alpha, turn),
            Lobe::Round { width, retro } => self.draw_round(width, retro),
            _ => {
                self.number("r", "sqrt(u2 * (2.0 - u2))");
                self.assign("x", "r * ca");
                self.assign("y", "r * sa");
                self.assign("z", "1.0 - u2");
            }
        }
    }

    fn draw_tilted(&mut self, factor: f64) {
        let f = decimal(-factor);
        for (name, expression) in [
            ("wx", format!("{f} * ox")),
            ("wy", format!("{f} * oy")),
            ("r", "sqrt(u2)".to_owned()),
            ("zx", "r * ca".to_owned()),
            ("zy", "r * sa".to_owned()),
            ("px", "zx + wx".to_owned()),
            ("py", "zy + wy".to_owned()),
            ("qx", "1.0 + wx * zx + wy * zy".to_owned()),
            ("qy", "wx * zy - wy * zx".to_owned()),
            ("q", "1.0 / (qx * qx + qy * qy)".to_owned()),
        ] {
            self.number(name, &expression);
        }
        self.assign("x", "(px * qx + py * qy) * q");
        self.assign("y", "(py * qx - px * qy) * q");
        // 1 - x^2 - y^2, which would be lost next to the horizon.
        self.assign(
            "z",
            "sqrt((1.0 - wx * wx - wy * wy) * max(1.0 - u2, 0.0) * q)",
        );
    }

    fn draw_ggx(&mut self, alpha: [f64; 2], turn: f64) {
        let (sin, cos) = sin_cos(turn);
        let [a, b] = alpha.map(decimal);
        for (name, expression) in [
            ("px", format!("{cos} * ox + {sin} * oy")),
            ("py", format!("{cos} * oy - {sin} * ox")),
            ("tx", format!("{a} * px")),
            ("ty", format!("{b} * py")),
            ("q", "1.0 / sqrt(tx * tx + ty * ty + oz * oz)".to_owned()),
            ("cap", "1.0 + oz * q".to_owned()),
            ("h", "u2 * cap".to_owned()),
            ("r", "sqrt(max(h * (2.0 - h), 0.0))".to_owned()),
            ("mx", format!("{a} * (r * ca + tx * q)")),
            ("my", format!("{b} * (r * sa + ty * q)")),
            ("mz", "(1.0 - u2) * cap".to_owned()),
            (
                "along",
                "2.0 * (px * mx + py * my + oz * mz) / max(mx * mx + my * my + mz * mz, 1e-30)"
                    .to_owned(),
            ),
            ("rx", "along * mx - px".to_owned()),
            ("ry", "along * my - py".to_owned()),
        ] {
            self.number(name, &expression);
        }
        self.assign("x", &format!("{cos} * rx - {sin} * ry"));
        self.assign("y", &format!("{sin} * rx + {cos} * ry"));
        self.assign("z", "along * mz - oz");
    }

    fn draw_round(&mut self, width: f64, retro: bool) {
        let s = decimal(width * width / 2.0);
        let sign = if retro { "" } else { "-" };
        for (name, expression) in [
            ("px", format!("{sign}ox")),
            ("py", format!("{sign}oy")),
            ("off", format!("2.0 * u2 * {s} / ({s} + 2.0 * (1.0 - u2))")),
            ("r", "sqrt(max(off * (2.0 - off), 0.0))".to_owned()),
            ("q", "1.0 / (1.0 + oz)".to_owned()),
            ("tx", "r * ca".to_owned()),
            ("ty", "r * sa".to_owned()),
            ("cap", "1.0 - off - (tx * px + ty * py) * q".to_owned()),
        ] {
            self.number(name, &expression);
        }
        self.assign("x", "tx + px * cap");
        self.assign("y", "ty + py * cap");
        self.assign("z", "(1.0 - off) * oz - tx * px - ty * py");
    }
}

/// The sine and cosine of an angle, as decimals.
fn sin_cos(angle: f64) -> (String, String) {
    let (sin, cos) = angle.sin_cos();
    (decimal(sin), decimal(cos))
}

/// A number in single precision, in common notation.
fn decimal(value: f64) -> String {
    let text = format!("{:?}", value as f32);
    if value < 0.0 {
        format!("({text})")
    } else {
        text
    }
}
