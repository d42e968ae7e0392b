"""What a channel's name says: its role, its quantity and which degree of freedom, in the words of laboratories."""

from __future__ import annotations

import itertools
import re
import unicodedata
from typing import NamedTuple

# In order of preference: what the simulation asks comes before what the controller is sent.
_ROLES = {
    "target": (
        "target targ tar tgt nominal calculated calc calculada desired des goal xt numerical numerisch "
        "numérique numérico objetivo objectif cible gewünschte gewünschter deseado deseada desejado desejada "
        "desiderato desiderata ziel 目標 目标 期望 목표 цель целевое целевой требуемое требуемый требуемая",
        "reference ref setpoint sp demand dmd soll sollwert vorgabe führungsgröße consigne consigna referencia "
        "riferimento référence imposé imposée demandé demandée imposto imposta impuesto impuesta rampe 設定 设定 "
        "給定 给定 参考 參考 参照 задание задания заданное заданный заданная задано задающее уставка 설정",
        "command cmd cmnd commanded dcmd xc comando comandado comandada comandato comandata commande commandé "
        "commandée predicted extrapolated compensated befehl kommando stellwert 命令 指令 команда 명령 지령",
    ),
    "measured": (
        "measured meas measure measurement mea msd mes xm ist istwert regelgröße mesure mesuré mesurée mesures "
        "medido medida medição misurato misurata misura rilevato rilevata gemessen messwert messung 計測 計測値 "
        "测量 測量 测定 測定 实测 実測 實測 измерено измеренное измеренный измеренная измерение 측정 계측 실측",
        "feedback fbk fdbk fb actual act achieved present lvdt encoder enc temposonic pv real réel réelle reel "
        "actuel actuelle effettivo effettiva attuale retour retroalimentacion retroazione rückmeldung tatsächliche "
        "tatsächlicher 反馈 反饋 フィードバック 实际 實際 実際 当前 當前 現在 факт фактическое фактический "
        "фактическая текущее текущий текущая обратная 실제 피드백 현재",
        "response resp sensor capteur датчик датчика réponse respuesta risposta antwort 応答 响应 響應 отклик 응답",
    ),
}
_QUANTITIES = {
    "displacement": (
        "disp displ displacement displacements dsp distance pos position positions stroke lvdt encoder temposonic "
        "xt xm xc dcmd weg hub lage verschiebung déplacement deplacement course desplazamiento posición posicion "
        "spostamento posizione posição deslocamento 位移 変位 變位 位置 ストローク 行程 перемещение положение 변위 "
        "위치"
    ),
    "force": (
        "force load frc kraft fuerza loadcell effort charge carga forza carico força 力 荷重 荷载 荷載 сила усилие "
        "하중 힘"
    ),
    "acceleration": (
        "acc accel acceleration ag beschleunigung accélération aceleración accelerazione 加速度 ускорение 가속도"
    ),
    "velocity": (
        "vel velo velocity qd dq speed geschwindigkeit vitesse velocidad velocidade velocità 速度 скорость 속도"
    ),
    "rotation": ("rotation rot angle angular drehung winkel"),
    "voltage": ("volt voltage current valve spool servo spannung tension voltaje 電圧 电压 電壓 阀 バルブ"),
    "other": (
        "temp temperature pressure strain error err diff fehler erreur erro errore regelabweichung time clock "
        "counter sample index trigger event count cycle cycles segment status flow temperatur druck pression "
        "presión 温度 压力 圧力 誤差 误差 偏差 時間 时间 時刻 ошибка время 시간 오차"
    ),
}
# x_t and x_m, disp_t and disp_m, ...: a letter behind the quantity.
_LETTERS = {"t": ("target", 0), "d": ("target", 0), "r": ("target", 1), "c": ("target", 2), "m": ("measured", 0)}
_BEFORE_LETTER = {
    "x",
    "y",
    "z",
    "q",
    "theta",
    "phi",
    "u",
    "d",
    "f",
    "disp",
    "displ",
    "displacement",
    "pos",
    "position",
    "force",
    "frc",
}
# Words that say which of several alike a channel is only where nothing else does: a pair may differ in them.
FILLERS = {"signal", "sig", "channel", "chan", "ch", "data", "value", "values", "val", "out", "output", "in", "input"}
FILLERS |= {
    "actuator",
    "servo",
    "axial",
    "controller",
    "control",
    "ctrl",
    "daq",
    "dac",
    "adc",
    "of",
    "the",
    "from",
    "to",
}
FILLERS |= {"ai", "ao", "absolute", "relative", "total", "raw", "filtered", "filt", "model", "specimen"}
FILLERS |= {"valor", "valeur", "wert", "канал", "値", "值", "信号"}
# What a name may consist of that says nothing at all.
GENERIC = {"channel", "chan", "ch", "column", "col", "ai", "ao", "untitled", "signal", "sig", "var", "data", "value"}
GENERIC |= {"values", "array", "input", "output", "kanal", "voie", "canal", "通道", "チャンネル"}


def plain(text: str) -> str:
    """A text in lower case without accents."""
    parted = unicodedata.normalize("NFKD", text.casefold())
    return unicodedata.normalize("NFC", "".join(c for c in parted if not "\u0300" <= c <= "\u036f"))


_ROLE_WORDS = {role: [set(map(plain, level.split())) for level in levels] for role, levels in _ROLES.items()}
_QUANTITY_WORDS = {kind: set(map(plain, known.split())) for kind, known in _QUANTITIES.items()}
# Scripts that set no blanks between words are parted at the words that are known.
_UNSPACED = sorted(
    {
        word
        for level in (*itertools.chain(*_ROLE_WORDS.values()), *_QUANTITY_WORDS.values(), FILLERS, GENERIC)
        for word in level
        if word >= "\u2e80"
    },
    key=len,
    reverse=True,
)
_PARTED = re.compile("|".join(map(re.escape, _UNSPACED)))
_COMPOUND = re.compile(
    r"\b(soll|ist|ziel)(?=weg|position|pos|kraft|lage|hub|verschiebung|last)|"
    r"(?<=weg|ion|aft|hub|age)(soll|ist)(?:wert)?\b"
)
# A letter or two before a word that stands in no other: uref, umeas, ctrltarget.
_BEHIND_LETTERS = re.compile(r"\b([a-z]{1,4})(ref|meas|cmd|fbk|target)\b")
_JOINED = re.compile(r"\b(set|load|feed|soll|ist) (point|cell|back|wert)\b")
# Words that say their role only beside others: the current position is no electric current, a set of data no target.
_BEFORE = (
    (re.compile(r"\bcurrent (?=pos|disp|stroke|value|force|load|angle)"), "actual "),
    (re.compile(r"\btrial (?=disp|dsp)"), "target "),
    (re.compile(r"\bcomm (?=disp|dsp)"), "command "),
    (re.compile(r"\bset (?=pos|disp|stroke|value|force|load|angle|velo)"), "setpoint "),
    (re.compile(r"\b(pos|position|disp|displ|velo|velocity) set\b"), r"\1 setpoint"),
    (re.compile(r"\bprocess (?:variable|value)\b"), "pv"),
)


def words(name: str) -> list[str]:
    """The words of a name, plain: divided at signs, at capitals and around numbers; two-part ones joined."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    text = " ".join(re.findall(r"[^\W\d_]+|\d+", _PARTED.sub(r" \g<0> ", plain(spaced))))
    text = _COMPOUND.sub(lambda m: f"{m[1]} " if m[1] else f" {m[2]}", text)
    text = _JOINED.sub(r"\1\2", _BEHIND_LETTERS.sub(r"\1 \2", text))
    for pattern, meant in _BEFORE:
        text = pattern.sub(meant, text)
    return text.split()


class Role(NamedTuple):
    """Target, measured or None; how plainly (0 best); and which of the words says it (-1 for none)."""

    name: str | None
    rank: int
    at: int


def role(found: list[str]) -> Role:
    """What words say of the role."""
    told = [
        Role(name, rank, i)
        for i, word in enumerate(found)
        for name, levels in _ROLE_WORDS.items()
        for rank, level in enumerate(levels)
        # A set point is numbered by nobody, a string potentiometer is.
        if word in level and not (word == "sp" and found[i + 1 : i + 2] and found[i + 1].isdigit())
    ]
    # "act1 cmd" is the command of actuator 1; "cmd fbk" is a measured command.
    clear = [one for one in told if found[one.at] != "act"] or told
    if clear:
        return next((one for one in clear if one.name == "measured"), clear[0])
    for i, (before, letter) in enumerate(itertools.pairwise(found)):
        if before in _BEFORE_LETTER and letter in _LETTERS:
            return Role(*_LETTERS[letter], i + 1)
    return Role(None, 0, -1)


def quantities(found: list[str]) -> list[tuple[int, str]]:
    """Which of the words name a quantity, and which."""
    return [(i, kind) for i, word in enumerate(found) for kind, known in _QUANTITY_WORDS.items() if word in known]
