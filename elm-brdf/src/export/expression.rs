//! Formulas of the common notation as trees, for what has no infix operators.

use super::error::ExportError;

/// A formula.
#[derive(Debug, PartialEq)]
pub(super) enum Expression {
    Number(f64),
    Name(String),
    Operation(Operator, Box<Self>, Box<Self>),
    Call(Function, Vec<Self>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Function {
    /// The arc tangent of the first over the second.
    Angle,
    Sqrt,
    Max,
}

impl Expression {
    /// Reads a formula.
    ///
    /// # Errors
    /// [`ExportError::Input`] for one that is none.
    pub(super) fn parse(text: &str) -> Result<Self, ExportError> {
        let mut tokens = Tokens { rest: text };
        tokens
            .sum()
            .filter(|_| tokens.next().is_none())
            .ok_or_else(|| ExportError::Input {
                name: text.to_owned(),
            })
    }
}

/// What is left to read: names and numbers, and single characters.
struct Tokens<'a> {
    rest: &'a str,
}

impl<'a> Tokens<'a> {
    fn peek(&self) -> Option<&'a str> {
        let rest = self.rest.trim_start();
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
        // A number may have a sign in its exponent.
        let is_number = rest.starts_with(|c: char| c.is_ascii_digit());
        let mut before = ' ';
        let end = rest
            .find(|c: char| {
                let goes_on = is_word(c) || is_number && before == 'e' && c == '-';
                before = c;
                !goes_on
            })
            .unwrap_or(rest.len());
        match end {
            0 => rest.chars().next().map(|c| &rest[..c.len_utf8()]),
            end => Some(&rest[..end]),
        }
    }

    fn next(&mut self) -> Option<&'a str> {
        let token = self.peek()?;
        self.rest = &self.rest.trim_start()[token.len()..];
        Some(token)
    }

    fn sum(&mut self) -> Option<Expression> {
        let operators = [("+", Operator::Add), ("-", Operator::Subtract)];
        self.chain(&operators, Self::product)
    }

    fn product(&mut self) -> Option<Expression> {
        let operators = [("*", Operator::Multiply), ("/", Operator::Divide)];
        self.chain(&operators, Self::operand)
    }

    fn chain(
        &mut self,
        operators: &[(&str, Operator)],
        part: impl Fn(&mut Self) -> Option<Expression>,
    ) -> Option<Expression> {
        let mut left = part(self)?;
        loop {
            let token = self.peek();
            let Some((_, operator)) = operators.iter().find(|(sign, _)| token == Some(sign)) else {
                return Some(left);
            };
            self.next();
            left = Expression::Operation(*operator, Box::new(left), Box::new(part(self)?));
        }
    }

    fn operand(&mut self) -> Option<Expression> {
        let token = self.next()?;
        if token == "(" {
            let inside = self.sum()?;
            return (self.next()? == ")").then_some(inside);
        }
        if let Ok(number) = token.parse() {
            return Some(Expression::Number(number));
        }
        if !token.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return None;
        }
        if self.peek() != Some("(") {
            return Some(Expression::Name(token.to_owned()));
        }
        let function = match token {
            "ANGLE" => Function::Angle,
            "sqrt" => Function::Sqrt,
            "max" => Function::Max,
            _ => return None,
        };
        self.next();
        let mut arguments = vec![self.sum()?];
        loop {
            match self.next()? {
                "," => arguments.push(self.sum()?),
                ")" => return Some(Expression::Call(function, arguments)),
                _ => return None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::inputs;
    use crate::features::Features;

    #[test]
    fn operators_bind_as_in_the_languages() {
        let name = |name: &str| Box::new(Expression::Name(name.to_owned()));
        let of = |operator, left, right| Expression::Operation(operator, left, right);
        let product = of(Operator::Multiply, name("b"), name("c"));
        let difference = of(Operator::Subtract, name("a"), Box::new(product));
        let expected = of(Operator::Subtract, Box::new(difference), name("d"));
        assert_eq!(Expression::parse("a - b * c - d").unwrap(), expected);
        let tiny = Box::new(Expression::Number(1e-30));
        let call = Expression::Call(Function::Max, vec![*name("x_1"), *tiny]);
        assert_eq!(Expression::parse(" max( x_1,1e-30 )").unwrap(), call);
    }

    #[test]
    fn what_is_no_formula_is_an_error() {
        for text in ["", "a +", "(a", "a b", "sin(a)", "max(a", "$", "a)", "ä"] {
            assert!(Expression::parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn every_input_has_a_formula() {
        let names = Features::ALL.into_iter().flat_map(Features::inputs);
        let formulas = names.map(|name| inputs::expression(name).unwrap());
        let locals = inputs::LOCALS.iter().map(|(_, formula)| *formula);
        for formula in formulas.chain(locals) {
            Expression::parse(formula).unwrap();
        }
    }
}
