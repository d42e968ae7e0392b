//! Where the numbers stand in a datagram.

/// Longest payload of a UDP datagram.
pub const MAX_DATAGRAM: usize = 65_507;
/// Most actuators taken.
pub const MAX_ACTUATORS: usize = 256;

/// How a number is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// IEEE single precision.
    F32,
    /// IEEE double precision.
    F64,
    /// Two's complement, 16 bit.
    I16,
    /// Unsigned, 16 bit.
    U16,
    /// Two's complement, 32 bit.
    I32,
    /// Unsigned, 32 bit.
    U32,
    /// Two's complement, 64 bit.
    I64,
    /// Unsigned, 64 bit.
    U64,
}

impl Number {
    /// All types with their names.
    pub const NAMES: [(&'static str, Number); 8] = [
        ("f32", Number::F32),
        ("f64", Number::F64),
        ("i16", Number::I16),
        ("u16", Number::U16),
        ("i32", Number::I32),
        ("u32", Number::U32),
        ("i64", Number::I64),
        ("u64", Number::U64),
    ];

    /// Its length in bytes.
    pub fn size(self) -> usize {
        match self {
            Number::I16 | Number::U16 => 2,
            Number::F32 | Number::I32 | Number::U32 => 4,
            Number::F64 | Number::I64 | Number::U64 => 8,
        }
    }

    /// Bits after which a counter of this type starts again at zero. A float never does; 64 bits stand for it.
    pub fn counter_bits(self) -> u32 {
        match self {
            Number::F32 | Number::F64 => 64,
            _ => 8 * self.size() as u32,
        }
    }

    /// The value at the start of `bytes`, which holds at least [`Number::size`] of them.
    fn value(self, bytes: &[u8], order: ByteOrder) -> f64 {
        match self {
            Number::F32 => f64::from(f32::from_bits(word(bytes, 4, order) as u32)),
            Number::F64 => f64::from_bits(word(bytes, 8, order)),
            Number::U64 => word(bytes, 8, order) as f64,
            _ => self.whole(bytes, order) as f64,
        }
    }

    /// The same of an integer type, exactly; the bits of a u64.
    fn whole(self, bytes: &[u8], order: ByteOrder) -> i64 {
        let word = word(bytes, self.size(), order);
        match self {
            Number::I16 => i64::from(word as u16 as i16),
            Number::I32 => i64::from(word as u32 as i32),
            _ => word as i64,
        }
    }

    /// A counter: whole, and of a float type not negative and no larger than it counts exactly.
    fn counter(self, bytes: &[u8], order: ByteOrder) -> Option<i64> {
        match self {
            Number::F32 => whole_counter(self.value(bytes, order), 1 << 24),
            Number::F64 => whole_counter(self.value(bytes, order), MAX_EXACT),
            _ => Some(self.whole(bytes, order)),
        }
    }
}

/// Largest whole number up to which double precision counts exactly.
const MAX_EXACT: i64 = 1 << 53;

/// A counter written as a floating-point number.
pub(crate) fn double_counter(value: f64) -> Option<i64> {
    whole_counter(value, MAX_EXACT)
}

fn whole_counter(value: f64, most: i64) -> Option<i64> {
    (value >= 0.0 && value <= most as f64 && value.fract() == 0.0).then_some(value as i64)
}

fn word(bytes: &[u8], size: usize, order: ByteOrder) -> u64 {
    let bytes = bytes[..size].iter();
    let add = |word: u64, byte: &u8| word << 8 | u64::from(*byte);
    match order {
        ByteOrder::Big => bytes.fold(0, add),
        ByteOrder::Little => bytes.rev().fold(0, add),
    }
}

/// Which end of a number comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteOrder {
    /// The least significant byte, as Intel machines have it.
    Little,
    /// The most significant byte: network order, LabVIEW's flattened strings.
    Big,
}

impl ByteOrder {
    /// Both with their names.
    pub const NAMES: [(&'static str, ByteOrder); 2] = [("little", ByteOrder::Little), ("big", ByteOrder::Big)];
}

/// One displacement of a sample: (raw - zero) scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// From the sample's first byte.
    pub offset: usize,
    /// How it is written.
    pub number: Number,
    /// Unit of the user over unit of the sender.
    pub scale: f64,
    /// The raw value that means zero.
    pub zero: f64,
}

/// The user's description of a datagram: `header_bytes`, then one or more samples of `sample_bytes`.
#[derive(Debug, Clone, PartialEq)]
pub struct LayoutConfig {
    /// Of all numbers.
    pub byte_order: ByteOrder,
    /// Bytes before the first sample, not read.
    pub header_bytes: usize,
    /// From one sample to the next.
    pub sample_bytes: usize,
    /// Offset and type; `None` where the sender counts nothing.
    pub counter: Option<(usize, Number)>,
    /// One field an actuator.
    pub target: Vec<Field>,
    /// One field an actuator.
    pub measured: Vec<Field>,
}

impl LayoutConfig {
    /// Little-endian doubles: counter, target_1, measured_1, target_2, ...
    pub fn doubles(n_actuators: usize) -> Self {
        let field = |i: usize| Field { offset: 8 * i, number: Number::F64, scale: 1.0, zero: 0.0 };
        Self {
            byte_order: ByteOrder::Little,
            header_bytes: 0,
            sample_bytes: 8 * (1 + 2 * n_actuators),
            counter: Some((0, Number::F64)),
            target: (0..n_actuators).map(|a| field(1 + 2 * a)).collect(),
            measured: (0..n_actuators).map(|a| field(2 + 2 * a)).collect(),
        }
    }

    /// Everything that is wrong with it, a line each.
    pub fn mistakes(&self) -> Vec<String> {
        let mut found = channel_mistakes(self.target.len(), self.measured.len());
        let size = self.sample_bytes;
        if size == 0 || self.header_bytes.saturating_add(size) > MAX_DATAGRAM {
            found.push(format!(
                "layout: header_bytes {} and sample_bytes {size} must make a datagram of 1 to {MAX_DATAGRAM} bytes with at \
                 least one sample",
                self.header_bytes
            ));
        }
        let mut within = |name: String, offset: usize, number: Number| {
            if offset.saturating_add(number.size()) > size {
                found.push(format!(
                    "layout: {name} at offset {offset} takes {} bytes and ends beyond sample_bytes {size}; offsets count from \
                     the sample's first byte",
                    number.size()
                ));
            }
        };
        if let Some((offset, number)) = self.counter {
            within("counter".to_owned(), offset, number);
        }
        for (name, fields) in [("target", &self.target), ("measured", &self.measured)] {
            for (i, field) in fields.iter().enumerate() {
                within(format!("{name}[{i}]"), field.offset, field.number);
            }
        }
        for (name, fields) in [("target", &self.target), ("measured", &self.measured)] {
            for (i, field) in fields.iter().enumerate() {
                found.extend(scale_mistake(&format!("{name}[{i}]"), field.scale));
                if !field.zero.is_finite() {
                    found.push(format!("layout: {name}[{i}].zero must be a finite number, not {}", field.zero));
                }
            }
        }
        found
    }
}

/// A target and a measured for each actuator.
pub(crate) fn channel_mistakes(n_target: usize, n_measured: usize) -> Vec<String> {
    if n_target == n_measured && (1..=MAX_ACTUATORS).contains(&n_target) {
        return Vec::new();
    }
    vec![format!(
        "layout: target and measured need one entry an actuator each, 1 to {MAX_ACTUATORS}; they have {n_target} and {n_measured}"
    )]
}

pub(crate) fn scale_mistake(name: &str, scale: f64) -> Option<String> {
    let wrong = !scale.is_finite() || scale == 0.0;
    wrong.then(|| format!("layout: {name}.scale must be a finite number other than zero, not {scale}"))
}

/// A checked layout.
#[derive(Debug, Clone)]
pub struct Layout {
    config: LayoutConfig,
}

impl Layout {
    /// Checks it.
    ///
    /// # Errors
    /// Everything that is wrong, a line each.
    pub fn new(config: LayoutConfig) -> Result<Self, Vec<String>> {
        let mistakes = config.mistakes();
        if mistakes.is_empty() { Ok(Self { config }) } else { Err(mistakes) }
    }

    /// Number of actuators.
    pub fn n_actuators(&self) -> usize {
        self.config.target.len()
    }

    /// Whether samples are numbered.
    pub fn is_counted(&self) -> bool {
        self.config.counter.is_some()
    }

    /// See [`Number::counter_bits`].
    pub fn counter_bits(&self) -> u32 {
        self.config.counter.map_or(64, |(_, number)| number.counter_bits())
    }

    /// Samples in a datagram of `len` bytes; `None` for a length that holds no whole number of them.
    pub fn n_samples(&self, len: usize) -> Option<usize> {
        let body = len.checked_sub(self.config.header_bytes)?;
        (body > 0 && body.is_multiple_of(self.config.sample_bytes)).then(|| body / self.config.sample_bytes)
    }

    /// The lengths of datagrams that are taken, in words.
    pub fn expected(&self) -> String {
        let LayoutConfig { header_bytes, sample_bytes, .. } = self.config;
        match header_bytes {
            0 => format!("{sample_bytes} bytes a sample"),
            _ => format!("a header of {header_bytes} bytes and {sample_bytes} bytes a sample"),
        }
    }

    /// Whether the counter of sample `i` counts only with its bytes in the other order.
    pub fn counts_in_other_order(&self, datagram: &[u8], i: usize) -> bool {
        let LayoutConfig { header_bytes, sample_bytes, byte_order, counter, .. } = &self.config;
        let Some((offset, number)) = counter else { return false };
        let at = &datagram[header_bytes + i * sample_bytes + offset..];
        let other = if *byte_order == ByteOrder::Little { ByteOrder::Big } else { ByteOrder::Little };
        number.counter(at, *byte_order).is_none() && number.counter(at, other).is_some()
    }

    /// Sample `i` of a datagram that has more than `i`. The counter is `Some(0)` where there is none, `None` where it is no count.
    pub fn decode(&self, datagram: &[u8], i: usize, target: &mut [f64], measured: &mut [f64]) -> Option<i64> {
        let LayoutConfig { header_bytes, sample_bytes, byte_order, .. } = self.config;
        let sample = &datagram[header_bytes + i * sample_bytes..][..sample_bytes];
        for (fields, values) in [(&self.config.target, target), (&self.config.measured, measured)] {
            for (field, value) in fields.iter().zip(values) {
                *value = (field.number.value(&sample[field.offset..], byte_order) - field.zero) * field.scale;
            }
        }
        self.config.counter.map_or(Some(0), |(offset, number)| number.counter(&sample[offset..], byte_order))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(layout: &Layout, datagram: &[u8], i: usize) -> (Option<i64>, Vec<f64>, Vec<f64>) {
        let n = layout.n_actuators();
        let (mut target, mut measured) = (vec![0.0; n], vec![0.0; n]);
        let counter = layout.decode(datagram, i, &mut target, &mut measured);
        (counter, target, measured)
    }

    #[test]
    fn the_default_is_what_simulink_and_labview_send_as_little_endian_doubles() {
        let layout = Layout::new(LayoutConfig::doubles(2)).unwrap();
        let datagram: Vec<u8> = [7.0, 1.0, 2.0, 3.0, 4.0, 8.0, 5.0, 6.0, 7.0, 8.0].map(f64::to_le_bytes).concat();
        assert_eq!(layout.n_samples(datagram.len()), Some(2));
        assert_eq!(decoded(&layout, &datagram, 0), (Some(7), vec![1.0, 3.0], vec![2.0, 4.0]));
        assert_eq!(decoded(&layout, &datagram, 1), (Some(8), vec![5.0, 7.0], vec![6.0, 8.0]));
    }

    #[test]
    fn a_counter_that_counts_only_in_the_other_byte_order_is_known() {
        let layout = Layout::new(LayoutConfig::doubles(1)).unwrap();
        let bytes = |order: fn(f64) -> [u8; 8], counter: f64| [counter, 1.0, 2.0].map(order).concat();
        assert!(layout.counts_in_other_order(&bytes(f64::to_be_bytes, 7.0), 0));
        assert!(!layout.counts_in_other_order(&bytes(f64::to_le_bytes, 7.0), 0));
        // No count in either order.
        assert!(!layout.counts_in_other_order(&bytes(f64::to_be_bytes, 7.5), 0));
    }

    #[test]
    fn every_type_is_read_in_both_byte_orders_with_scale_and_zero() {
        for (name, number) in Number::NAMES {
            for order in [ByteOrder::Little, ByteOrder::Big] {
                let mut bytes = match number {
                    Number::F32 => 100f32.to_be_bytes().to_vec(),
                    Number::F64 => 100f64.to_be_bytes().to_vec(),
                    _ => 100i64.to_be_bytes()[8 - number.size()..].to_vec(),
                };
                if order == ByteOrder::Little {
                    bytes.reverse();
                }
                let field = Field { offset: 0, number, scale: 0.5, zero: 90.0 };
                let layout = Layout::new(LayoutConfig {
                    byte_order: order,
                    header_bytes: 0,
                    sample_bytes: number.size(),
                    counter: Some((0, number)),
                    target: vec![field],
                    measured: vec![field],
                })
                .unwrap();
                assert_eq!(decoded(&layout, &bytes, 0), (Some(100), vec![5.0], vec![5.0]), "{name} {order:?}");
            }
        }
    }

    #[test]
    fn negative_numbers_and_the_largest_unsigned_ones_keep_their_value() {
        let values = [
            (Number::I16, vec![0xff, 0xfe], -2.0),
            (Number::I32, (-2i32).to_be_bytes().to_vec(), -2.0),
            (Number::I64, (-2i64).to_be_bytes().to_vec(), -2.0),
            (Number::U16, vec![0xff, 0xfe], 65534.0),
            (Number::U32, u32::MAX.to_be_bytes().to_vec(), f64::from(u32::MAX)),
            (Number::U64, u64::MAX.to_be_bytes().to_vec(), u64::MAX as f64),
        ];
        for (number, bytes, expected) in values {
            assert_eq!(number.value(&bytes, ByteOrder::Big), expected, "{number:?}");
        }
    }

    #[test]
    fn only_whole_samples_behind_the_header_are_taken() {
        let layout = Layout::new(LayoutConfig { header_bytes: 4, ..LayoutConfig::doubles(1) }).unwrap();
        assert_eq!(layout.n_samples(4 + 24), Some(1));
        assert_eq!(layout.n_samples(4 + 48), Some(2));
        for len in [0, 3, 4, 27, 29, 24, 65_507] {
            assert_eq!(layout.n_samples(len), None, "{len}");
        }
    }

    #[test]
    fn a_float_counter_is_a_count_as_far_as_it_counts_exactly() {
        let f32_counter = |v: f32| Number::F32.counter(&v.to_le_bytes(), ByteOrder::Little);
        let f64_counter = |v: f64| Number::F64.counter(&v.to_le_bytes(), ByteOrder::Little);
        assert_eq!(f64_counter(0.0), Some(0));
        assert_eq!(f64_counter(9_007_199_254_740_992.0), Some(1 << 53));
        assert_eq!(f32_counter(16_777_216.0), Some(1 << 24));
        assert_eq!(f32_counter(33_554_432.0), None);
        for bad in [f64::NAN, f64::INFINITY, -1.0, 0.5, 1e300, f64::NEG_INFINITY] {
            assert_eq!(f64_counter(bad), None, "{bad}");
        }
    }

    #[test]
    fn all_mistakes_are_told_at_once() {
        let mut config = LayoutConfig::doubles(1);
        config.sample_bytes = 20;
        config.target[0].scale = 0.0;
        config.measured.push(config.measured[0]);
        config.measured[1].zero = f64::NAN;
        let mistakes = Layout::new(config).unwrap_err();
        assert_eq!(mistakes.len(), 5, "{mistakes:#?}");
        assert!(mistakes.iter().any(|m| m.contains("target and measured need one entry an actuator")));
        assert!(mistakes.iter().any(|m| m.contains("measured[0] at offset 16 takes 8 bytes")));
    }
}
