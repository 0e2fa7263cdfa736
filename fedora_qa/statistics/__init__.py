"""Statistics of a sequence: the paper's sequence and flow tables, and more; no verdicts."""

from fedora_qa.statistics.collector import StatisticsCollector, WindowStatistics

__all__ = ["StatisticsCollector", "WindowStatistics"]
