"""The report that `servotwin paper` writes: a study of the paper's servo, its tables, pictures and page."""

from servotwin.paper.report import PaperReport, write_paper_report

__all__ = ["PaperReport", "write_paper_report"]
