//! The languages, and how each spells what the others spell otherwise.
//!
//! The common notation is arithmetic with decimal literals, names, and calls of `abs`, `cos`, `exp`,
//! `floor`, `max`, `min`, `sign` (of 0 it may be anything from -1 to 1), `sin` and `sqrt`; it is valid as
//! it is in the three shader languages, for numbers and vectors of four alike.

/// A language that a network can be written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Language {
    /// The OpenGL Shading Language: ES 3.00 (WebGL2) and later, 1.30 and later.
    Glsl,
    /// WebGPU's shading language.
    Wgsl,
    /// Direct3D's shading language.
    Hlsl,
    /// C99, with the standard library's mathematics.
    C,
}

impl Language {
    /// The language's name, which is also the usual extension of its files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Glsl => "glsl",
            Self::Wgsl => "wgsl",
            Self::Hlsl => "hlsl",
            Self::C => "c",
        }
    }

    /// The type of a number.
    pub(super) fn number(self) -> &'static str {
        match self {
            Self::Wgsl => "f32",
            Self::Glsl | Self::Hlsl | Self::C => "float",
        }
    }

    /// The type of four numbers; in C neurons are taken one at a time.
    pub(super) fn four(self) -> &'static str {
        match self {
            Self::Glsl => "vec4",
            Self::Wgsl => "vec4<f32>",
            Self::Hlsl => "float4",
            Self::C => "float",
        }
    }

    /// The type of a direction or colour, in shaders.
    pub(super) fn three(self) -> &'static str {
        match self {
            Self::Glsl => "vec3",
            Self::Wgsl => "vec3<f32>",
            Self::Hlsl | Self::C => "float3",
        }
    }

    /// The type of two uniform numbers, in shaders.
    pub(super) fn two(self) -> &'static str {
        match self {
            Self::Glsl => "vec2",
            Self::Wgsl => "vec2<f32>",
            Self::Hlsl | Self::C => "float2",
        }
    }

    /// A definition of a name that does not change, from common notation.
    pub(super) fn define(self, kind: &str, name: &str, expression: &str) -> String {
        let expression = self.expression(expression);
        match self {
            Self::Wgsl => format!("let {name} = {expression};"),
            Self::C => format!("const {kind} {name} = {expression};"),
            Self::Glsl | Self::Hlsl => format!("{kind} {name} = {expression};"),
        }
    }

    /// The head of a function.
    pub(super) fn head(self, result: &str, name: &str, arguments: &[(&str, &str)]) -> String {
        let list = |one: &dyn Fn(&str, &str) -> String| {
            let list: Vec<String> = arguments
                .iter()
                .map(|(kind, name)| one(kind, name))
                .collect();
            list.join(", ")
        };
        match self {
            Self::Wgsl => {
                let arguments = list(&|kind, name| format!("{name}: {kind}"));
                format!("fn {name}({arguments}) -> {result} {{")
            }
            Self::C => {
                let arguments = list(&|kind, name| format!("{kind} {name}"));
                format!("static {result} {name}({arguments}) {{")
            }
            Self::Glsl | Self::Hlsl => {
                let arguments = list(&|kind, name| format!("{kind} {name}"));
                format!("{result} {name}({arguments}) {{")
            }
        }
    }

    /// A number in single precision, so that reading it gives the same bits.
    pub(super) fn literal(self, value: f64) -> String {
        let value = value as f32;
        match self {
            Self::C => format!("{value:?}f"),
            _ => format!("{value:?}"),
        }
    }

    /// Common notation in this language.
    pub(super) fn expression(self, common: &str) -> String {
        if self != Self::C {
            return common.to_owned();
        }
        let common = common.replace("sign(", "copysign(1.0, ");
        let mut out = String::new();
        let mut rest = common.as_str();
        while let Some(first) = rest.chars().next() {
            let (token, tail) = rest.split_at(token_length(rest));
            match first {
                '0'..='9' => {
                    out.push_str(token);
                    // Whole numbers are indices.
                    if token.contains(['.', 'e']) {
                        out.push('f');
                    }
                }
                _ => out.push_str(match token {
                    "abs" => "fabsf",
                    "cos" => "cosf",
                    "copysign" => "copysignf",
                    "exp" => "expf",
                    "floor" => "floorf",
                    "max" => "fmaxf",
                    "min" => "fminf",
                    "sin" => "sinf",
                    "sqrt" => "sqrtf",
                    other => other,
                }),
            }
            rest = tail;
        }
        out
    }
}

/// Bytes of the number, the name, or else the character that `text` begins with.
fn token_length(text: &str) -> usize {
    let of = |part: &dyn Fn(char) -> bool| text.find(|c: char| !part(c)).unwrap_or(text.len());
    match text.as_bytes() {
        [b'0'..=b'9', ..] => {
            let digits = of(&|c| c.is_ascii_digit() || c == '.');
            // An exponent, with or without a sign.
            let sign = match &text.as_bytes()[digits..] {
                [b'e', b'-', ..] => 2,
                [b'e', ..] => 1,
                _ => return digits,
            };
            let exponent = &text[digits + sign..];
            let more = exponent.find(|c: char| !c.is_ascii_digit());
            digits + sign + more.unwrap_or(exponent.len())
        }
        [first, ..] if first.is_ascii_alphabetic() => {
            of(&|c| c.is_ascii_alphanumeric() || c == '_')
        }
        _ => text.chars().next().map_or(0, char::len_utf8),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_c_numbers_and_functions_are_of_single_precision() {
        let c = Language::C.expression("max(x[2] - 1.5e-4, abs(y)) * 1e16 + sign(e1)");
        assert_eq!(
            c,
            "fmaxf(x[2] - 1.5e-4f, fabsf(y)) * 1e16f + copysignf(1.0f, e1)"
        );
    }
}
