//! The names of the inputs of a recorder, and what on and off mean.

use std::collections::BTreeMap;

use ser_console::Harmless;
use ser_evidence::site::Point;
use ser_proto::Inputs;

/// The points of one recorder by their inputs. Inputs without a point keep their numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Points(BTreeMap<u8, Point>);

impl FromIterator<Point> for Points {
    fn from_iter<I: IntoIterator<Item = Point>>(points: I) -> Points {
        Points(points.into_iter().map(|point| (point.input, point)).collect())
    }
}

impl Points {
    /// The name of an input, as it is in the site file.
    pub(crate) fn name(&self, input: u8) -> Option<&str> {
        self.0.get(&input).map(|point| point.name.as_str())
    }

    /// The input with this name.
    pub(crate) fn input(&self, name: &str) -> Option<u8> {
        self.0.values().find(|point| point.name == name).map(|point| point.input)
    }

    /// The inputs that have names.
    pub(crate) fn inputs(&self) -> impl Iterator<Item = u8> {
        self.0.keys().copied()
    }

    /// An input in a state, as `52-1 closed OPEN`, or `7 OFF` if it has no name.
    pub(crate) fn state(&self, input: u8, is_on: bool) -> String {
        match self.0.get(&input) {
            Some(Point { name, on, off, .. }) => {
                let text = if is_on { on } else { off };
                format!("{} {}", Harmless(name).line(), Harmless(text).line())
            }
            None => format!("{input} {}", if is_on { "ON" } else { "OFF" }),
        }
    }

    /// The inputs that are on, as `52-1 closed CLOSED, 3`; `none` if there are none. Without any
    /// names as `1 3`.
    pub(crate) fn on(&self, state: Inputs) -> String {
        if state.is_empty() {
            return "none".to_owned();
        }
        if self.0.is_empty() {
            return state.to_string();
        }
        let name = |input: u8| match self.0.contains_key(&input) {
            true => self.state(input, true),
            false => input.to_string(),
        };
        state.numbers().map(name).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    /// Input 3 is `52-1 closed`, CLOSED or OPEN.
    pub(crate) fn points() -> Points {
        let file = "site = \"A\"\ntime_zone = \"UTC\"\n[[recorder]]\nname = \"R\"\n[[point]]\n\
                    input = 3\nname = \"52-1 closed\"\non = \"CLOSED\"\noff = \"OPEN\"\n";
        ser_evidence::site::read(file).expect("a site").points.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::testing::points;
    use super::*;

    #[test]
    fn an_input_has_its_name_or_its_number() {
        assert_eq!(points().state(3, true), "52-1 closed CLOSED");
        assert_eq!(points().state(3, false), "52-1 closed OPEN");
        assert_eq!(points().state(4, false), "4 OFF");
        assert_eq!((points().name(3), points().name(4)), (Some("52-1 closed"), None));
        assert_eq!((points().input("52-1 closed"), points().input("x")), (Some(3), None));
        assert_eq!(points().inputs().collect::<Vec<_>>(), [3]);
    }

    #[test]
    fn inputs_that_are_on_are_listed() {
        assert_eq!(points().on(Inputs(0b101)), "1, 52-1 closed CLOSED");
        assert_eq!(Points::default().on(Inputs(0b101)), "1 3");
        assert_eq!(points().on(Inputs(0)), "none");
    }
}
