//! Report as text: tree, joints, dynamics and warnings in columns.

use super::{JointReport, LinkReport, RobotReport};
use nalgebra::Matrix3;
use std::collections::HashMap;
use std::fmt;

/// Maximum width of tables and sentences \[characters\].
const WIDTH: usize = 120;
/// Spaces between columns.
const COLUMN_GAP: usize = 2;
/// Minimum width of a shortened column.
const MIN_COLUMN_WIDTH: usize = 24;
/// Number of tree levels that are drawn; for deeper links, the levels nearest to the root are cut off.
const MAX_TREE_LEVELS: usize = 16;

impl fmt::Display for RobotReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write_robot(f)?;
        if self.warnings.is_empty() {
            return writeln!(f, "\nNo warnings");
        }
        writeln!(f, "\n{}", pluralized(self.warnings.len(), "warning"))?;
        for warning in &self.warnings {
            writeln!(f)?;
            match (&warning.file, warning.line) {
                (Some(file), Some(line)) => writeln!(f, "{file}:{line}: {}", warning.kind)?,
                _ => writeln!(f, "{}", warning.kind)?,
            }
            for line in wrap_lines(&warning.message, WIDTH - 4) {
                writeln!(f, "    {line}")?;
            }
        }
        Ok(())
    }
}

fn pluralized(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

impl RobotReport {
    /// The report as text without its warnings, for programs that display these in another way.
    pub fn without_warnings(&self) -> impl fmt::Display {
        fmt::from_fn(|f| self.write_robot(f))
    }

    fn write_robot(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let movable = self.joints.iter().filter(|j| j.kind != "fixed").count();
        writeln!(f, "{}   ({})", self.robot, self.files.join(" + "))?;
        writeln!(
            f,
            "{}, {}: {movable} movable, {} fixed",
            pluralized(self.links.len(), "link"),
            pluralized(self.joints.len(), "joint"),
            self.joints.len() - movable
        )?;
        let com = self
            .com
            .map(|c| format!(", center of mass in the world ({}) m", c.map(|x| format_number(x, 4)).join(", ")));
        writeln!(f, "total mass {} kg{}", format_number(self.total_mass, 6), com.unwrap_or_default())?;

        write!(f, "\nLinks\n\n{}", self.tree())?;
        let inertias = self.inertia_table();
        if !inertias.rows.is_empty() {
            write!(f, "\nPrincipal moments of inertia about the center of mass (kg m²)\n\n{inertias}")?;
        }
        if movable > 0 {
            write!(f, "\nMovable joints (axis in the joint frame, SI units)\n\n{}", self.joint_table())?;
            self.write_couplings(f)?;
        }
        if !self.columns.is_empty() {
            write!(f, "\nAt this position\n\n{}", self.dynamics_table())?;
        }
        Ok(())
    }

    /// Tree of links, depth first, children in the order of the files.
    fn tree(&self) -> Table {
        let mut children: HashMap<&str, Vec<&LinkReport>> = HashMap::new();
        let mut open: Vec<(&LinkReport, String, Branch)> = Vec::new();
        for link in &self.links {
            match &link.parent {
                Some(parent) => children.entry(parent).or_default().push(link),
                None => open.push((link, String::new(), Branch::Root)),
            }
        }
        let by_child: HashMap<&str, &JointReport> = self.joints.iter().map(|j| (j.child.as_str(), j)).collect();
        let mut table = Table::new("<link <joint <type >mass_[kg] <?center_of_mass_in_link_[m]");
        while let Some((link, trunk, branch)) = open.pop() {
            let joint = by_child.get(link.name.as_str());
            table.push([
                format!("{trunk}{}{}", branch.connector(), link.name),
                joint.map_or_else(|| "-".to_owned(), |j| j.name.clone()),
                joint.map_or_else(|| "root".to_owned(), |j| j.kind.to_owned()),
                if link.mass == 0.0 { "-".to_owned() } else { format_fixed(link.mass, 4) },
                link.com.filter(|_| link.mass != 0.0).map_or_else(|| "-".to_owned(), |c| format_vector(&c)),
            ]);
            let below = children.remove(link.name.as_str()).unwrap_or_default();
            let trunk = truncated_prefix(trunk + branch.continuation());
            let count = below.len();
            for (i, child) in below.into_iter().enumerate().rev() {
                let branch = if i + 1 == count { Branch::Last } else { Branch::Inner };
                open.push((child, trunk.clone(), branch));
            }
        }
        table
    }

    /// Principal moments of each link with an inertia, in ascending order.
    fn inertia_table(&self) -> Table {
        let mut table = Table::new("<link >smallest >middle >largest");
        for (link, inertia) in self.links.iter().filter_map(|link| Some((link, link.inertia?))) {
            let moments = Matrix3::from_fn(|row, column| inertia[row][column]).symmetric_eigenvalues();
            let mut moments: [f64; 3] = moments.into();
            moments.sort_by(f64::total_cmp);
            let [a, b, c] = moments.map(|moment| format!("{moment:.4e}"));
            table.push([link.name.clone(), a, b, c]);
        }
        table
    }

    fn joint_table(&self) -> Table {
        let mut table = Table::new("<joint <type <parent <child <axis >lower >upper >effort >speed");
        for joint in self.joints.iter().filter(|j| j.kind != "fixed") {
            let limit = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format_number(v, 4));
            table.push([
                joint.name.clone(),
                joint.kind.to_owned(),
                joint.parent.clone(),
                joint.child.clone(),
                joint.axis.map(|x| format_number(x, 3)).join(" "),
                limit(joint.lower),
                limit(joint.upper),
                limit(joint.effort),
                limit(joint.velocity),
            ]);
        }
        table
    }

    fn write_couplings(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let couplings: Vec<_> = self.joints.iter().filter_map(|j| j.mimic.as_ref().map(|m| (&j.name, m))).collect();
        let width = couplings.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        if width > 0 {
            writeln!(f, "\nMimic joints\n")?;
        }
        for (name, mimic) in couplings {
            write!(f, "{name:<width$} = ")?;
            if mimic.multiplier != 1.0 {
                write!(f, "{} * ", format_number(mimic.multiplier, 4))?;
            }
            write!(f, "{}", mimic.joint)?;
            if mimic.offset != 0.0 {
                let sign = if mimic.offset < 0.0 { '-' } else { '+' };
                write!(f, " {sign} {}", format_number(mimic.offset.abs(), 4))?;
            }
            writeln!(f)?;
        }
        Ok(())
    }

    fn dynamics_table(&self) -> Table {
        let mut table = Table::new("<coordinate >position >inertia >gravity_effort");
        let positions: HashMap<&str, f64> =
            self.joint_names.iter().map(String::as_str).zip(self.qpos.iter().copied()).collect();
        for (i, (column, torque)) in self.columns.iter().zip(&self.gravity_torque).enumerate() {
            table.push([
                column.clone(),
                positions.get(column.as_str()).map_or_else(|| "-".to_owned(), |q| format!("{q:.4}")),
                format_fixed(self.mass_matrix[i][i], 6),
                // Avoids a negative zero.
                format!("{:.4}", if torque.abs() < 5e-5 { 0.0 } else { *torque }),
            ]);
        }
        table
    }
}

/// Position of a link among the children of its parent.
#[derive(Clone, Copy)]
enum Branch {
    Root,
    Inner,
    Last,
}

impl Branch {
    fn connector(self) -> &'static str {
        match self {
            Self::Root => "",
            Self::Inner => "├─",
            Self::Last => "└─",
        }
    }

    /// Prefix of the lines of all descendants.
    fn continuation(self) -> &'static str {
        match self {
            Self::Root => "",
            Self::Inner => "│ ",
            Self::Last => "  ",
        }
    }
}

fn truncated_prefix(trunk: String) -> String {
    let levels = trunk.chars().count() / 2;
    if levels < MAX_TREE_LEVELS {
        return trunk;
    }
    std::iter::once('…').chain(" ".chars()).chain(trunk.chars().skip(2 * (levels - MAX_TREE_LEVELS + 2))).collect()
}

/// Rows of cells in columns.
struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

struct Column {
    heading: String,
    /// True for right-aligned columns, such as numbers.
    right: bool,
    /// True for a column that is left out if the table is too wide.
    optional: bool,
}

impl Table {
    /// Parses column definitions such as `<name >mass <?remark`: `<` left-aligned, `>` right-aligned, `?` optional.
    fn new(columns: &str) -> Self {
        let column = |text: &str| Column {
            heading: text.trim_start_matches(['<', '>', '?']).replace('_', " "),
            right: text.starts_with('>'),
            optional: text.contains('?'),
        };
        Self { columns: columns.split(' ').map(column).collect(), rows: Vec::new() }
    }

    fn push<const N: usize>(&mut self, row: [String; N]) {
        self.rows.push(row.into());
    }

    /// Width of each column so that a line fits; 0 for a left-out column.
    fn widths(&self) -> Vec<usize> {
        let cells = |i: usize| self.rows.iter().map(move |row| row[i].chars().count());
        let mut widths: Vec<usize> =
            self.columns.iter().enumerate().map(|(i, c)| cells(i).max().unwrap_or(0).max(c.heading.len())).collect();
        let excess = |widths: &[usize]| {
            let shown = widths.iter().filter(|&&w| w > 0);
            (shown.clone().sum::<usize>() + COLUMN_GAP * shown.count().saturating_sub(1)).saturating_sub(WIDTH)
        };
        for (i, column) in self.columns.iter().enumerate() {
            if column.optional && excess(&widths) > 0 {
                widths[i] = 0;
            }
        }
        loop {
            let excess = excess(&widths);
            let narrowable = (0..widths.len()).filter(|&i| !self.columns[i].right && widths[i] > MIN_COLUMN_WIDTH);
            // The first column identifies the row, so it is shortened last.
            let Some(widest) = narrowable.max_by_key(|&i| (i > 0, widths[i])).filter(|_| excess > 0) else { break };
            widths[widest] = widths[widest].saturating_sub(excess).max(MIN_COLUMN_WIDTH);
        }
        widths
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heading: Vec<String> = self.columns.iter().map(|c| c.heading.clone()).collect();
        let widths = self.widths();
        for line in std::iter::once(&heading).chain(&self.rows) {
            let mut text = String::new();
            for ((cell, column), &width) in line.iter().zip(&self.columns).zip(&widths).filter(|(_, w)| **w > 0) {
                let cell = elide(cell, width);
                text += &if column.right { format!("{cell:>width$}") } else { format!("{cell:<width$}") };
                text += &" ".repeat(COLUMN_GAP);
            }
            writeln!(f, "{}", text.trim_end())?;
        }
        Ok(())
    }
}

/// Returns the text; the middle is replaced by `…` if the text is wider than `width`.
fn elide(text: &str, width: usize) -> String {
    let count = text.chars().count();
    if count <= width {
        return text.to_owned();
    }
    let (head, tail) = (width / 2, width - width / 2 - 1);
    text.chars().take(head).chain(['…']).chain(text.chars().skip(count - tail)).collect()
}

/// Formats with `decimals`, so that columns line up. Numbers that would lose all but one digit, and numbers from 1e9
/// on, get an exponent.
fn format_fixed(value: f64, decimals: usize) -> String {
    let vanishes = value != 0.0 && value.abs() < 10f64.powi(1 - decimals as i32);
    if vanishes || value.abs() >= 1e9 { format!("{value:.3e}") } else { format!("{value:.decimals$}") }
}

/// Formats with at most `decimals` decimals, without trailing zeros. Numbers from 1e9 on, and numbers that would round
/// to 0, get an exponent, such as `1.00e30`.
fn format_number(value: f64, decimals: usize) -> String {
    if value != 0.0 && (value.abs() >= 1e9 || value.abs() < 0.5 * 10f64.powi(-(decimals as i32))) {
        return format!("{value:.2e}");
    }
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Formats the components with four decimals, each at least seven characters wide.
fn format_vector(v: &[f64; 3]) -> String {
    v.map(|x| format!("{:7.4}", if x.abs() < 5e-5 { 0.0 } else { x })).join(" ").trim_end().to_owned()
}

/// Breaks lines between words. A word longer than `width` stays whole, so that paths can be copied.
fn wrap_lines(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let Some(line) = lines.last_mut() else { break };
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(word.to_owned());
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers() {
        assert_eq!(
            [format_number(1.0, 4), format_number(-0.5, 4), format_number(2.792_52, 4)],
            ["1", "-0.5", "2.7925"]
        );
        assert_eq!(
            [format_number(0.0, 4), format_number(-1e-17, 4), format_number(1e30, 4)],
            ["0", "-1.00e-17", "1.00e30"]
        );
        assert_eq!(
            [format_fixed(0.0, 4), format_fixed(0.25, 4), format_fixed(2e-6, 6)],
            ["0.0000", "0.2500", "2.000e-6"]
        );
        assert_eq!(elide("depth_camera", 7), "dep…era");
        assert_eq!(wrap_lines("one two a_very_long_word end", 8), ["one two", "a_very_long_word", "end"]);
    }

    #[test]
    fn wide_tables() {
        let mut table = Table::new("<name <other >number <?remark");
        table.push(["n".repeat(50), "o".repeat(70), "1".to_owned(), "r".repeat(20)]);
        let text = table.to_string();
        assert!(text.lines().all(|l| l.chars().count() <= WIDTH), "{text}");
        assert!(text.contains(&"n".repeat(50)) && text.contains('…') && !text.contains("remark"), "{text}");
    }

    #[test]
    fn deep_tree() {
        let name = |i: usize| format!("link{i}");
        let link = |i: usize| LinkReport {
            name: name(i),
            parent: i.checked_sub(1).map(name),
            mass: 0.0,
            com: None,
            inertia: None,
            pose: [0.0; 7],
        };
        let report = RobotReport {
            robot: "chain".to_owned(),
            files: Vec::new(),
            total_mass: 0.0,
            com: None,
            links: (0..3000).map(link).collect(),
            joints: Vec::new(),
            joint_names: Vec::new(),
            qpos: Vec::new(),
            columns: Vec::new(),
            mass_matrix: Vec::new(),
            gravity_torque: Vec::new(),
            warnings: Vec::new(),
        };
        let text = report.to_string();
        assert!(text.contains("link2999") && text.lines().all(|l| l.chars().count() <= WIDTH));
    }
}
